//! The source files of the workspace.

use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

/// The folders of all crates of the workspace.
pub fn crate_folders() -> Vec<PathBuf> {
    let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let (_, list) = manifest.split_once("members = [").unwrap();
    let (list, _) = list.split_once(']').unwrap();
    let members = list.split(',').map(|member| member.trim().trim_matches('"'));
    let folders: Vec<PathBuf> =
        members.filter(|member| !member.is_empty()).map(|member| root().join(member)).collect();
    assert!(folders.len() > 5, "no list of crates: {list}");
    folders
}

/// All Rust files below a folder, in order. Folders of build output and of other crates are left
/// out.
pub fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                if !path.ends_with("target") && !path.join("Cargo.toml").exists() {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// Whether a file below `folder` holds tests only.
pub fn is_test_file(folder: &Path, file: &Path) -> bool {
    let below = file.strip_prefix(folder).unwrap();
    let name = below.file_stem().unwrap().to_string_lossy();
    below.starts_with("tests")
        || name == "tests"
        || name.starts_with("test_")
        || name.ends_with("_tests")
}

/// The code up to a `mod tests {`, which stands last, without comments.
pub fn code_without_tests(text: &str) -> String {
    let code = text.lines().take_while(|line| !line.starts_with("mod tests {"));
    code.map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Writes the file `name` below `folder`, for a planted violation.
pub fn plant(folder: &Path, name: &str, text: &str) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}
