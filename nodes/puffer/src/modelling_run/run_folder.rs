//! The run folder.

use crate::exit_status::usage_error;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};

/// The folder of a run, which is new or empty.
pub(crate) struct RunFolder {
    path: PathBuf,
}

impl RunFolder {
    /// The folder that the user named, or `runs/NAME`, with a number behind if that is taken.
    ///
    /// # Errors
    /// A named folder that holds something already, or one that cannot be made.
    pub(crate) fn create(named: Option<&Path>, name: &str) -> Result<RunFolder> {
        let path = match named {
            Some(path) if is_taken(path) => {
                return Err(usage_error(format!(
                    "--out {}: holds something already; name another folder or remove it",
                    path.display()
                )));
            }
            Some(path) => path.to_path_buf(),
            None => untaken_path(&Path::new("runs").join(name)),
        };
        std::fs::create_dir_all(&path)
            .with_context(|| format!("cannot create the run folder {}", path.display()))?;
        // The nodes may run elsewhere.
        let path = path.canonicalize()?;
        Ok(RunFolder { path })
    }

    /// The folder itself.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// A file in it.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

fn is_taken(path: &Path) -> bool {
    path.exists() && std::fs::read_dir(path).map_or(true, |mut entries| entries.next().is_some())
}

/// `path`, or with the first number behind it that gives a path that is not taken.
fn untaken_path(path: &Path) -> PathBuf {
    std::iter::once(path.to_path_buf())
        .chain((2..).map(|number| numbered_path(path, number)))
        .find(|candidate| !is_taken(candidate))
        .unwrap_or_else(|| path.to_path_buf())
}

fn numbered_path(path: &Path, number: u32) -> PathBuf {
    let mut name = path.as_os_str().to_os_string();
    name.push(format!("-{number}"));
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taken_folder_is_never_overwritten() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a");
        RunFolder::create(Some(&path), "x").unwrap();
        RunFolder::create(Some(&path), "x").unwrap();
        std::fs::write(path.join("mesh.ply"), "m").unwrap();
        let error = RunFolder::create(Some(&path), "x").err().unwrap().to_string();
        assert!(error.contains("holds something already"), "{error}");
        assert_eq!(untaken_path(&path), root.path().join("a-2"));
    }
}
