//! The modules of core use only what stands above them in `lib.rs`.

use crate::source::{code_without_tests, is_test_file, plant, root, rust_files};
use std::fs;
use std::path::{Path, PathBuf};

#[test]
fn the_modules_of_core_use_only_what_stands_above_them() {
    let src = root().join("core/src");
    let found = violations(&src);
    assert!(found.is_empty(), "a module uses one that stands below it:\n{}", found.join("\n"));
}

#[test]
fn planted_uses_of_later_modules_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let src = folder.path();
    plant(src, "lib.rs", "pub mod error;\npub mod geometry;\npub mod mesh;\npub mod filter;\n");
    plant(src, "error.rs", "pub struct Error;\n");
    plant(
        src,
        "geometry/mod.rs",
        "use crate::{Error, error::E};\n// crate::filter in a comment\n\
         #[cfg(test)]\nmod tests {\n    use crate::filter::x;\n}\n",
    );
    plant(src, "mesh/io/mod.rs", "pub(in crate::mesh) fn f() {}\nuse crate::mesh::Mesh;\n");
    plant(src, "mesh/tests.rs", "use crate::filter::x;\n");
    plant(src, "filter.rs", "use crate::{mesh::Mesh, geometry};\n");
    assert_eq!(violations(src), Vec::<String>::new());

    plant(src, "geometry/kdtree.rs", "use crate::mesh::Mesh;\n");
    plant(src, "mesh/io/mod.rs", "fn f() { super::super::filter::x() }\n");
    plant(
        src,
        "mesh/mod.rs",
        "use crate::{\n    Error,\n    geometry::{a, b},\n    filter::x,\n};\n",
    );
    let found = violations(src);
    assert_eq!(found.len(), 3, "{found:?}");
    for text in ["geometry/kdtree.rs: mesh", "mesh/io/mod.rs: filter", "mesh/mod.rs: filter"] {
        assert!(found.iter().any(|f| f.ends_with(text)), "{text} not in {found:?}");
    }
}

/// Each use of a later module, as `file: module`; `src` is the folder of lib.rs.
fn violations(src: &Path) -> Vec<String> {
    let list = fs::read_to_string(src.join("lib.rs")).unwrap();
    let order: Vec<&str> = list
        .lines()
        .filter_map(|line| line.trim().strip_prefix("pub mod ")?.strip_suffix(';'))
        .collect();
    assert!(order.len() > 3, "lib.rs lists no modules: {list}");
    let mut found = Vec::new();
    for (own, module) in order.iter().enumerate() {
        for file in files_of(src, module) {
            let depth = depth(src, &file);
            let code = code_without_tests(&fs::read_to_string(&file).unwrap());
            for used in modules_used(&code, depth) {
                if order.iter().position(|m| *m == used).is_some_and(|place| place > own) {
                    found.push(format!("{}: {used}", file.display()));
                }
            }
        }
    }
    found
}

/// The files of a module, without those of its tests.
fn files_of(src: &Path, module: &str) -> Vec<PathBuf> {
    let single = Some(src.join(format!("{module}.rs"))).filter(|file| file.is_file());
    let below = rust_files(&src.join(module)).into_iter();
    single.into_iter().chain(below).filter(|file| !is_test_file(src, file)).collect()
}

/// How many `super` lead from a file to the root of the crate.
fn depth(src: &Path, file: &Path) -> usize {
    let parts = file.strip_prefix(src).unwrap().components().count();
    if file.ends_with("mod.rs") { parts - 1 } else { parts }
}

/// The first names after `crate::`, or after as many `super::` as lead to the crate's root.
fn modules_used(code: &str, depth: usize) -> Vec<String> {
    let supers = "super::".repeat(depth);
    let mut used = Vec::new();
    for way in ["crate::", &supers] {
        for (at, _) in code.match_indices(way) {
            let rest = &code[at + way.len()..];
            match rest.strip_prefix('{') {
                Some(group) => used.extend(group_names(group)),
                None => used.push(first_name(rest)),
            }
        }
    }
    used
}

/// The first name of each path of a `{a::b, c::{d, e}}` whose opening brace is gone.
fn group_names(group: &str) -> Vec<String> {
    let (mut level, mut starts) = (1, vec![0]);
    for (at, sign) in group.char_indices() {
        match sign {
            '{' => level += 1,
            '}' => level -= 1,
            ',' if level == 1 => starts.push(at + 1),
            _ => {}
        }
        if level == 0 {
            break;
        }
    }
    starts.into_iter().map(|start| first_name(&group[start..])).collect()
}

fn first_name(text: &str) -> String {
    let text = text.trim_start();
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}
