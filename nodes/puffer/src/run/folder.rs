//! The run folder.

use crate::failure::usage;
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
                return Err(usage(format!(
                    "--out {}: holds something already; name another folder or remove it",
                    path.display()
                )));
            }
            Some(path) => path.to_path_buf(),
            None => free_name(&Path::new("runs").join(name)),
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

fn free_name(path: &Path) -> PathBuf {
    let numbered = |n: u32| {
        let mut name = path.as_os_str().to_os_string();
        name.push(format!("-{n}"));
        PathBuf::from(name)
    };
    std::iter::once(path.to_path_buf())
        .chain((2..).map(numbered))
        .find(|candidate| !is_taken(candidate))
        .unwrap_or_else(|| path.to_path_buf())
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
        assert_eq!(free_name(&path), root.path().join("a-2"));
    }
}
