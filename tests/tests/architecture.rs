//! The rules of the house: core knows nothing of ROS, and its modules use only what stands above them.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// In the name of any crate that speaks ROS or runs an event loop.
const FORBIDDEN: [&str; 5] = ["ros2", "rustdds", "tokio", "cyclors", "dds"];

#[test]
fn the_dependency_tree_of_core_holds_no_ros() {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let output = Command::new(cargo)
        .args(["tree", "-p", "puffer_core", "-e", "normal", "--prefix", "none", "--offline"])
        .current_dir(root())
        .output()
        .unwrap();
    let tree = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(tree.contains("nalgebra"), "not a dependency tree: {tree}");
    assert_eq!(forbidden(&tree), Vec::<&str>::new());
}

#[test]
fn the_modules_of_core_use_only_what_stands_above_them() {
    let src = root().join("core/src");
    let found = violations(&src);
    assert!(found.is_empty(), "a module uses one that stands below it:\n{}", found.join("\n"));
}

#[test]
fn the_checker_finds_planted_violations() {
    assert_eq!(forbidden("serde v1.0.0\nrustdds v0.11.4\nadd_one v1"), ["rustdds"]);
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    write("lib.rs", "pub mod error;\npub mod geometry;\npub mod mesh;\npub mod filter;\n");
    write("error.rs", "pub struct Error;\n");
    write(
        "geometry/mod.rs",
        "use crate::{Error, error::E};\n// crate::filter in a comment\n\
         #[cfg(test)]\nmod tests {\n    use crate::filter::x;\n}\n",
    );
    write("mesh/io/mod.rs", "pub(in crate::mesh) fn f() {}\nuse crate::mesh::Mesh;\n");
    write("mesh/tests.rs", "use crate::filter::x;\n");
    write("filter.rs", "use crate::{mesh::Mesh, geometry};\n");
    assert_eq!(violations(folder.path()), Vec::<String>::new());

    write("geometry/kdtree.rs", "use crate::mesh::Mesh;\n");
    write("mesh/io/mod.rs", "fn f() { super::super::filter::x() }\n");
    write("mesh/mod.rs", "use crate::{\n    Error,\n    geometry::{a, b},\n    filter::x,\n};\n");
    let found = violations(folder.path());
    assert_eq!(found.len(), 3, "{found:?}");
    for text in ["geometry/kdtree.rs: mesh", "mesh/io/mod.rs: filter", "mesh/mod.rs: filter"] {
        assert!(found.iter().any(|f| f.ends_with(text)), "{text} not in {found:?}");
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The crates of a `cargo tree` that core must not depend on.
fn forbidden(tree: &str) -> Vec<&str> {
    let names = tree.lines().filter_map(|line| line.split(' ').next());
    let is_dds = |name: &&str| FORBIDDEN.iter().any(|word| name.contains(word));
    names.filter(is_dds).collect()
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
            let code = without_tests(&fs::read_to_string(&file).unwrap());
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
    let mut files = Vec::new();
    let mut folders = vec![src.join(module)];
    files.extend(Some(src.join(format!("{module}.rs"))).filter(|f| f.is_file()));
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if name.ends_with(".rs") && name != "tests.rs" && !name.ends_with("_tests.rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// How many `super` lead from a file to the root of the crate.
fn depth(src: &Path, file: &Path) -> usize {
    let parts = file.strip_prefix(src).unwrap().components().count();
    if file.ends_with("mod.rs") { parts - 1 } else { parts }
}

/// The code up to a `mod tests {`, which stands last, without comments.
fn without_tests(text: &str) -> String {
    let code = text.lines().take_while(|line| !line.starts_with("mod tests {"));
    code.map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
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
    let part = |c: &char| c.is_alphanumeric() || *c == '_';
    text.trim_start().chars().take_while(part).collect()
}
