//! Which files make up a bag.

use super::error::BagError;
use super::rosbag2::MetadataFile;
use std::path::{Path, PathBuf};

const SQLITE: &[u8] = b"SQLite format 3\0";

/// The MCAP files of a path: the file itself, or those of a rosbag2 folder in their order.
pub(crate) fn files(path: &Path) -> Result<Vec<PathBuf>, BagError> {
    if path.is_dir() { in_folder(path) } else { Ok(vec![path.to_owned()]) }
}

fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let metadata = folder.join("metadata.yaml");
    if !metadata.exists() {
        return unlisted(folder);
    }
    let text = std::fs::read_to_string(&metadata).map_err(BagError::io(&metadata, "read"))?;
    let file: MetadataFile = serde_yaml_ng::from_str(&text)
        .map_err(|e| BagError::no_bag(&metadata, format!("it is not rosbag2's: {e}")))?;
    let information = file.rosbag2_bagfile_information;
    if information.storage_identifier == "sqlite3" {
        return Err(sqlite(folder));
    }
    if information.storage_identifier != "mcap" {
        let reason = format!("its storage is {}", information.storage_identifier);
        return Err(BagError::no_bag(folder, reason));
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
        return Err(BagError::no_bag(folder, reason));
    }
    if information.relative_file_paths.is_empty() {
        return unlisted(folder);
    }
    // Old versions wrote the folder's own name before the file's.
    let place = |name: &String| {
        let whole = folder.join(name);
        match Path::new(name).file_name() {
            Some(last) if !whole.exists() => folder.join(last),
            _ => whole,
        }
    };
    Ok(information.relative_file_paths.iter().map(place).collect())
}

/// The files of a folder without metadata: of a recording that was cut off.
fn unlisted(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let entries = std::fs::read_dir(folder).map_err(BagError::io(folder, "read the folder"))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    let with = |extension: &str| -> Vec<PathBuf> {
        files.iter().filter(|f| f.extension().is_some_and(|e| e == extension)).cloned().collect()
    };
    if !with("mcap").is_empty() {
        return Ok(with("mcap"));
    }
    if !with("db3").is_empty() {
        return Err(sqlite(folder));
    }
    Err(BagError::no_bag(folder, "the folder holds no .mcap file"))
}

/// What a file is that does not begin as an MCAP file does.
pub(crate) fn wrong_file(path: &Path, start: &[u8]) -> BagError {
    if start.starts_with(SQLITE) {
        return sqlite(path);
    }
    if start.starts_with(b"#ROSBAG") {
        let reason = format!(
            "it is a bag of ROS 1; convert it: rosbags-convert --src {} --dst {}_ros2 --dst-storage mcap",
            path.display(),
            path.with_extension("").display()
        );
        return BagError::no_bag(path, reason);
    }
    if start.is_empty() {
        return BagError::no_bag(path, "the file is empty");
    }
    BagError::no_bag(path, "it does not begin as one does")
}

fn sqlite(path: &Path) -> BagError {
    // A single .db3 file is converted as the folder that it lies in.
    let folder = match path.extension() {
        Some(extension) if extension == "db3" => path.parent().unwrap_or(path),
        _ => path,
    };
    let folder = folder.display();
    BagError::no_bag(
        path,
        format!(
            "it is a rosbag2 of the storage sqlite3; convert it: pip install rosbags && rosbags-convert --src {folder} \
             --dst {folder}_mcap --dst-storage mcap"
        ),
    )
}
