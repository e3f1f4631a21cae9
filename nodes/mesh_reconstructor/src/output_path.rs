//! Where a mesh may be written.

use std::path::{Component, Path, PathBuf};

/// Extensions of the mesh formats.
const MESH_EXTENSIONS: [&str; 4] = ["ply", "glb", "stl", "obj"];

/// The file that a request asks for within `folder`; `mesh.ply` if it names none.
///
/// # Errors
/// What is wrong, in words, if the path leaves the folder, its folder does not exist, or its
/// extension is not that of a mesh format.
pub(crate) fn resolve_output_path(folder: &str, asked: &str) -> Result<PathBuf, String> {
    let folder = if folder.is_empty() { Path::new(".") } else { Path::new(folder) };
    let asked = Path::new(if asked.is_empty() { "mesh.ply" } else { asked });
    let relative = asked.strip_prefix(folder).unwrap_or(asked);
    if !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(format!(
            "{} lies outside the output folder {}: give a path within it, or set mesh.output_folder",
            asked.display(),
            folder.display()
        ));
    }
    let extension = relative.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if !MESH_EXTENSIONS.contains(&extension.to_ascii_lowercase().as_str()) {
        return Err(format!(
            "{}: the name must end in .{}",
            asked.display(),
            MESH_EXTENSIONS.join(", .")
        ));
    }
    let path = folder.join(relative);
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(parent) = parent.filter(|p| !p.is_dir()) {
        return Err(format!("{}: there is no folder {}", path.display(), parent.display()));
    }
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_stays_within_the_folder_and_names_a_format() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().to_str().unwrap();
        assert_eq!(resolve_output_path(root, "").unwrap(), folder.path().join("mesh.ply"));
        assert_eq!(resolve_output_path(root, "a.glb").unwrap(), folder.path().join("a.glb"));
        let whole = folder.path().join("b.PLY");
        assert_eq!(resolve_output_path(root, whole.to_str().unwrap()).unwrap(), whole);
        for (asked, says) in [
            ("../a.ply", "outside the output folder"),
            ("/etc/a.ply", "outside the output folder"),
            ("a.txt", "must end in .ply"),
            ("missing/a.ply", "there is no folder"),
        ] {
            let error = resolve_output_path(root, asked).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }
}
