//! How code is laid out and named.

use crate::source::{code_without_tests, crate_folders, is_test_file, plant, rust_files};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Columns of a comment line at most, as of code.
const MAX_COLUMNS: usize = 100;
/// The name that says nothing of what a function does.
const OF: &str = "of";
/// Words that begin the definition of a type.
const TYPE_WORDS: [&str; 5] = ["struct", "enum", "trait", "type", "union"];

#[test]
fn comments_end_within_the_columns_of_code() {
    assert_none("comment lines that are too long", long_comments);
}

#[test]
fn functions_say_what_they_do_and_none_is_called_of() {
    assert_none("functions `of`", functions_called_of);
}

#[test]
fn a_crate_has_no_two_types_of_one_name() {
    assert_none("type names that a crate has twice", repeated_types);
}

#[test]
fn planted_violations_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let long = "x".repeat(MAX_COLUMNS);
    let code = format!("let text = \"// {long}\";\n/// Ends {}\n", "x".repeat(MAX_COLUMNS - 9));
    plant(folder.path(), "src/a.rs", &format!("pub struct A;\nfn offset() {{}}\n{code}"));
    let associated = "impl Iterator for A {\n    type Item = u8;\n}\n";
    plant(folder.path(), "src/b.rs", &format!("{associated}{associated}struct B;\n"));
    plant(folder.path(), "src/b_tests.rs", "struct B;\n");
    assert_eq!(long_comments(folder.path()), Vec::<String>::new());
    assert_eq!(functions_called_of(folder.path()), Vec::<String>::new());
    assert_eq!(repeated_types(folder.path()), Vec::<String>::new());

    plant(folder.path(), "src/c.rs", &format!("    // {long}\npub enum A {{}}\nfn {OF}() {{}}\n"));
    plant(folder.path(), "tests/d.rs", &format!("//! {long}\nconst fn {OF}<T>(t: T) {{}}\n"));
    assert_eq!(long_comments(folder.path()).len(), 2);
    assert_eq!(functions_called_of(folder.path()).len(), 2);
    assert_eq!(repeated_types(folder.path()).len(), 1);
}

fn assert_none(what: &str, check: impl Fn(&Path) -> Vec<String>) {
    let found: Vec<String> = crate_folders().iter().flat_map(|folder| check(folder)).collect();
    assert!(found.is_empty(), "{what}:\n{}", found.join("\n"));
}

/// Every line of a crate as its place (`file:line`) and its text.
fn lines_of(folder: &Path) -> Vec<(String, String)> {
    let mut lines = Vec::new();
    for file in rust_files(folder) {
        let text = fs::read_to_string(&file).unwrap();
        for (index, line) in text.lines().enumerate() {
            lines.push((format!("{}:{}", file.display(), index + 1), line.to_owned()));
        }
    }
    lines
}

fn long_comments(folder: &Path) -> Vec<String> {
    let lines = lines_of(folder).into_iter();
    let long = lines.filter(|(_, line)| {
        line.trim_start().starts_with("//") && line.chars().count() > MAX_COLUMNS
    });
    long.map(|(place, _)| place).collect()
}

fn functions_called_of(folder: &Path) -> Vec<String> {
    let lines = lines_of(folder).into_iter();
    let found = lines.filter(|(_, line)| {
        let code = line.split("//").next().unwrap_or_default();
        let code = code.split('"').next().unwrap_or_default();
        ["(", "<"].iter().any(|sign| code.contains(&format!("fn {OF}{sign}")))
    });
    found.map(|(place, _)| place).collect()
}

/// The names that two types of a crate have, with the files that define them; tests are left out.
fn repeated_types(folder: &Path) -> Vec<String> {
    let src = folder.join("src");
    let mut types: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for file in rust_files(&src) {
        if is_test_file(&src, &file) {
            continue;
        }
        let code = code_without_tests(&fs::read_to_string(&file).unwrap());
        for name in code.lines().filter_map(defined_type) {
            types.entry(name.to_owned()).or_default().push(file.clone());
        }
    }
    let repeated = types.iter().filter(|(_, files)| files.len() > 1);
    repeated.map(|(name, files)| format!("{name}: {files:?}")).collect()
}

/// The name of the type that a line of code begins to define.
fn defined_type(line: &str) -> Option<&str> {
    let mut words = line.split_whitespace().peekable();
    words.next_if(|word| *word == "pub" || word.starts_with("pub("));
    let kind = words.next_if(|word| TYPE_WORDS.contains(word))?;
    // An associated type belongs to its implementation.
    if kind == "type" && line.starts_with(' ') {
        return None;
    }
    let name = words.next()?;
    let end = name.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(name.len());
    Some(&name[..end]).filter(|name| !name.is_empty())
}
