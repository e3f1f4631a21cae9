//! Headers and rows of binary little-endian PLY files.

/// What the header of a file to be written tells.
#[derive(Default)]
pub(crate) struct Layout {
    lines: Vec<String>,
}

impl Layout {
    /// A header with a comment line for each of `comments`.
    pub(crate) fn new(comments: &[String]) -> Layout {
        let mut layout = Layout::default();
        for comment in comments {
            // A line break would end the comment and spoil the header.
            let lines = comment.lines().map(|line| format!("comment {}", line.replace('\r', " ")));
            layout.lines.extend(lines);
        }
        layout
    }

    /// Adds an `obj_info` line.
    pub(crate) fn info(&mut self, key: &str, value: usize) {
        self.lines.push(format!("obj_info {key} {value}"));
    }

    /// Adds an element with its properties, each as "TYPE NAME".
    pub(crate) fn element(&mut self, name: &str, count: usize, properties: &[&str]) {
        self.lines.push(format!("element {name} {count}"));
        self.lines.extend(properties.iter().map(|property| format!("property {property}")));
    }

    /// The header, to which the rows are then appended.
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
