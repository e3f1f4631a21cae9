//! Which files make up a bag, and what a path is that is no bag.

use super::bag_error::BagError;
use super::rosbag2_metadata::MetadataFile;
use std::path::{Path, PathBuf};

/// The first bytes of a file of SQLite.
const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";

/// The MCAP files of a path: the file itself, or those of a rosbag2 folder in their order.
pub(crate) fn files(path: &Path) -> Result<Vec<PathBuf>, BagError> {
    if path.is_dir() { listed_files(path) } else { Ok(vec![path.to_owned()]) }
}

/// The files that the folder's metadata lists.
fn listed_files(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let metadata = folder.join("metadata.yaml");
    if !metadata.exists() {
        return unlisted_files(folder);
    }
    let text = std::fs::read_to_string(&metadata).map_err(BagError::io(&metadata, "read"))?;
    let file: MetadataFile = serde_yaml_ng::from_str(&text)
        .map_err(|e| BagError::not_a_bag(&metadata, format!("it is not rosbag2's: {e}")))?;
    let information = file.rosbag2_bagfile_information;
    if information.storage_identifier == "sqlite3" {
        return Err(sqlite_error(folder));
    }
    if information.storage_identifier != "mcap" {
        let reason = format!("its storage is {}", information.storage_identifier);
        return Err(BagError::not_a_bag(folder, reason));
    }
    if !information.compression_mode.is_empty()
        && !information.compression_mode.eq_ignore_ascii_case("none")
    {
        let mode = information.compression_mode;
        let reason = format!(
            "rosbag2 compressed it ({mode}); unpack it: rosbags-convert --src {} --dst {}_plain --dst-storage mcap",
            folder.display(),
            folder.display()
        );
        return Err(BagError::not_a_bag(folder, reason));
    }
    if information.relative_file_paths.is_empty() {
        return unlisted_files(folder);
    }
    Ok(information.relative_file_paths.iter().map(|name| locate(folder, name)).collect())
}

/// The path of a listed file: old versions of rosbag2 wrote the folder's own name before the
/// file's.
fn locate(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    match Path::new(name).file_name() {
        Some(last) if !path.exists() => folder.join(last),
        _ => path,
    }
}

/// The MCAP files of a folder whose metadata is missing or lists none, as of a recording that was
/// cut off.
fn unlisted_files(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let entries = std::fs::read_dir(folder).map_err(BagError::io(folder, "read the folder"))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    let has_sqlite = files.iter().any(|file| has_extension(file, "db3"));
    files.retain(|file| has_extension(file, "mcap"));
    if !files.is_empty() {
        return Ok(files);
    }
    if has_sqlite {
        return Err(sqlite_error(folder));
    }
    Err(BagError::not_a_bag(folder, "the folder holds no .mcap file"))
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e == extension)
}

/// The error of a file that begins with `start` and not as an MCAP file does.
pub(crate) fn wrong_format_error(path: &Path, start: &[u8]) -> BagError {
    if start.starts_with(SQLITE_MAGIC) {
        return sqlite_error(path);
    }
    if start.starts_with(b"#ROSBAG") {
        let reason = format!(
            "it is a bag of ROS 1; convert it: rosbags-convert --src {} --dst {}_ros2 --dst-storage mcap",
            path.display(),
            path.with_extension("").display()
        );
        return BagError::not_a_bag(path, reason);
    }
    if start.is_empty() {
        return BagError::not_a_bag(path, "the file is empty");
    }
    BagError::not_a_bag(path, "it does not begin as one does")
}

/// The error of a bag of rosbag2's storage sqlite3.
fn sqlite_error(path: &Path) -> BagError {
    // A single .db3 file is converted as the folder that it lies in.
    let folder = match path.extension() {
        Some(extension) if extension == "db3" => path.parent().unwrap_or(path),
        _ => path,
    };
    let folder = folder.display();
    BagError::not_a_bag(
        path,
        format!(
            "it is a rosbag2 of the storage sqlite3; convert it: pip install rosbags && rosbags-convert --src {folder} \
             --dst {folder}_mcap --dst-storage mcap"
        ),
    )
}
