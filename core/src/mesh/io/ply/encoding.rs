//! Writing of binary little-endian PLY files.

/// The header of a file to be written.
#[derive(Default)]
pub(crate) struct PlyHeader {
    lines: Vec<String>,
}

impl PlyHeader {
    /// A header with a comment line for each of `comments`.
    pub(crate) fn new(comments: &[String]) -> PlyHeader {
        let mut header = PlyHeader::default();
        for comment in comments {
            // A line break would end the comment and corrupt the header.
            let lines = comment.lines().map(|line| format!("comment {}", line.replace('\r', " ")));
            header.lines.extend(lines);
        }
        header
    }

    /// Adds an `obj_info` line.
    pub(crate) fn add_info(&mut self, key: &str, value: usize) {
        self.lines.push(format!("obj_info {key} {value}"));
    }

    /// Adds an element with its properties, each as "TYPE NAME".
    pub(crate) fn add_element(&mut self, name: &str, count: usize, properties: &[&str]) {
        self.lines.push(format!("element {name} {count}"));
        self.lines.extend(properties.iter().map(|property| format!("property {property}")));
    }

    /// The bytes of the header, to which the rows are then appended.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        let body: String = self.lines.iter().map(|line| format!("{line}\n")).collect();
        format!("ply\nformat binary_little_endian 1.0\n{body}end_header\n").into_bytes()
    }
}

/// Appends numbers as `float`.
pub(crate) fn push_floats(bytes: &mut Vec<u8>, values: impl IntoIterator<Item = f32>) {
    for value in values {
        bytes.extend_from_slice(&value.to_le_bytes());
    }
}
