//! No circle of files: what two files need of each other belongs into a third.

use crate::source::{code_without_tests, crate_folders, is_test_file, plant, rust_files};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

#[test]
fn no_crate_has_a_circle_of_files() {
    let circles: Vec<String> =
        crate_folders().iter().flat_map(|folder| circles(&folder.join("src"))).collect();
    assert!(circles.is_empty(), "files that use each other:\n{}", circles.join("\n"));
}

#[test]
fn planted_circles_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let src = folder.path();
    plant(src, "lib.rs", "mod a;\nmod b;\nmod c;\npub use a::A;\n");
    // `B` comes through the door of `b`, from a file that uses nothing.
    plant(src, "a.rs", "use crate::b::{B, inner::{X, Y}};\npub struct A(B);\n");
    plant(src, "b/mod.rs", "mod inner;\npub use inner::B;\n");
    plant(src, "b/inner.rs", "// use crate::A;\npub struct B;\n");
    plant(src, "c.rs", "pub fn f() {}\n#[cfg(test)]\nmod tests {\n    use crate::a::A;\n}\n");
    assert_eq!(circles(src), Vec::<String>::new());

    // Through a re-export, a path within code, and a door that defines something itself.
    plant(src, "b/inner.rs", "use crate::A;\npub struct B;\n");
    plant(src, "c/mod.rs", "mod d;\nuse d::g;\npub struct C;\n");
    plant(src, "c/d.rs", "use super::C;\npub fn g() { crate::b::B; }\n");
    fs::remove_file(src.join("c.rs")).unwrap();
    let found = circles(src);
    assert_eq!(found.len(), 2, "{found:?}");
    for text in ["a, b::inner", "c, c::d"] {
        assert!(found.iter().any(|circle| circle.ends_with(text)), "{text} not in {found:?}");
    }
}

/// A module by the names that lead to it from the root of its crate.
type Module = Vec<String>;

/// What a file uses of others.
#[derive(Default)]
struct UsedPaths {
    /// Paths as they are written.
    used: Vec<Vec<String>>,
    /// The path behind each name that the file re-exports.
    re_exported: BTreeMap<String, Vec<String>>,
}

/// The circles of files below `src`: for each, the modules that use each other.
fn circles(src: &Path) -> Vec<String> {
    let mut files: BTreeMap<Module, UsedPaths> = BTreeMap::new();
    for file in rust_files(src) {
        if !is_test_file(src, &file) {
            let code = code_without_tests(&fs::read_to_string(&file).unwrap());
            files.insert(module_of(src, &file), used_paths(&code));
        }
    }
    let uses: BTreeMap<&Module, BTreeSet<&Module>> = files
        .iter()
        .map(|(module, paths)| {
            let targets = paths.used.iter().filter_map(|path| resolve(&files, module, path, 0));
            (module, targets.filter(|target| *target != module).collect())
        })
        .collect();
    let reached: BTreeMap<&Module, BTreeSet<&Module>> =
        uses.keys().map(|module| (*module, reachable(&uses, module))).collect();
    let mut found = Vec::new();
    let mut seen: BTreeSet<&Module> = BTreeSet::new();
    for (module, targets) in &reached {
        if targets.contains(module) && !seen.contains(module) {
            let mutual = targets.iter().filter(|target| reached[**target].contains(module));
            let circle: Vec<&Module> = mutual.copied().collect();
            seen.extend(&circle);
            let names: Vec<String> = circle.iter().map(|module| module.join("::")).collect();
            found.push(format!("{}: {}", src.display(), names.join(", ")));
        }
    }
    found
}

fn module_of(src: &Path, file: &Path) -> Module {
    let below = file.strip_prefix(src).unwrap().with_extension("");
    let mut names: Module =
        below.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    if matches!(names.last().map(String::as_str), Some("mod" | "lib" | "main")) {
        names.pop();
    }
    names
}

/// The modules that `from` uses, and what those use, and so on.
fn reachable<'a>(
    uses: &BTreeMap<&'a Module, BTreeSet<&'a Module>>,
    from: &Module,
) -> BTreeSet<&'a Module> {
    let mut found = BTreeSet::new();
    let mut open: Vec<&Module> = uses[from].iter().copied().collect();
    while let Some(module) = open.pop() {
        if found.insert(module) {
            open.extend(uses[module].iter().copied());
        }
    }
    found
}

/// The file in which a path that is written in `module` ends, through re-exports.
fn resolve<'a>(
    files: &'a BTreeMap<Module, UsedPaths>,
    module: &Module,
    path: &[String],
    depth: usize,
) -> Option<&'a Module> {
    const MAX_RE_EXPORTS: usize = 8;
    let mut base = module.clone();
    let mut rest = path;
    match rest.first()?.as_str() {
        "crate" => {
            base.clear();
            rest = &rest[1..];
        }
        "self" => rest = &rest[1..],
        "super" => {
            while rest.first().is_some_and(|name| name == "super") {
                base.pop();
                rest = &rest[1..];
            }
        }
        first => {
            let child = [&base[..], &[first.to_owned()]].concat();
            if !files.contains_key(&child) {
                return None;
            }
        }
    }
    while let Some(name) = rest.first() {
        let child = [&base[..], std::slice::from_ref(name)].concat();
        if !files.contains_key(&child) {
            break;
        }
        base = child;
        rest = &rest[1..];
    }
    let (found, paths) = files.get_key_value(&base)?;
    let behind = rest.first().and_then(|name| paths.re_exported.get(name));
    match behind.filter(|_| depth < MAX_RE_EXPORTS) {
        Some(behind) => {
            let full = [behind, &rest[1..]].concat();
            resolve(files, found, &full, depth + 1).or(Some(found))
        }
        None => Some(found),
    }
}

fn used_paths(code: &str) -> UsedPaths {
    let mut paths = UsedPaths::default();
    let mut other_code = String::new();
    let mut rest = code;
    while let Some(at) = use_statement(rest) {
        let (before, statement) = rest.split_at(at);
        other_code.push_str(before);
        let (tree, after) = statement["use ".len()..].split_once(';').unwrap_or((statement, ""));
        rest = after;
        let line = before.rsplit('\n').next().unwrap_or_default();
        for path in paths_of_tree(tree) {
            match path.last() {
                Some(name) if line.trim_start().starts_with("pub") => {
                    paths.re_exported.insert(name.clone(), path);
                }
                _ => paths.used.push(path),
            }
        }
    }
    other_code.push_str(rest);
    for way in ["crate::", "super::"] {
        paths.used.extend(other_code.match_indices(way).map(|(at, _)| path_at(&other_code[at..])));
    }
    paths
}

/// Where the next `use` statement begins.
fn use_statement(code: &str) -> Option<usize> {
    code.match_indices("use ").map(|(at, _)| at).find(|at| {
        let line = code[..*at].rsplit('\n').next().unwrap_or_default().trim();
        line.is_empty() || line == "pub" || (line.starts_with("pub(") && line.ends_with(')'))
    })
}

/// The path of names that a text begins with.
fn path_at(text: &str) -> Vec<String> {
    let end = text.find(|c| !is_name_part(c) && c != ':').unwrap_or(text.len());
    text[..end].split("::").take_while(|name| !name.is_empty()).map(str::to_owned).collect()
}

fn is_name_part(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The paths of a use tree such as `a::{b, c::{d as e, self}}`.
fn paths_of_tree(tree: &str) -> Vec<Vec<String>> {
    let tree = tree.trim();
    let Some(open) = tree.find('{') else {
        let path = tree.split(" as ").next().unwrap_or_default();
        let names = path.split("::").map(str::trim);
        return vec![names.filter(|name| !name.is_empty()).map(str::to_owned).collect()];
    };
    let prefix = tree[..open].split("::").map(str::trim);
    let prefix: Vec<String> = prefix.filter(|name| !name.is_empty()).map(str::to_owned).collect();
    let body = &tree[open + 1..tree.rfind('}').unwrap_or(tree.len())];
    let (mut level, mut start) = (0, 0);
    let mut parts = Vec::new();
    for (at, sign) in body.char_indices() {
        match sign {
            '{' => level += 1,
            '}' => level -= 1,
            ',' if level == 0 => {
                parts.push(&body[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&body[start..]);
    let filled = parts.into_iter().filter(|part| !part.trim().is_empty());
    let paths = filled.flat_map(paths_of_tree);
    paths
        .map(|mut path| {
            path.retain(|name| name != "self");
            [&prefix[..], &path].concat()
        })
        .collect()
}
