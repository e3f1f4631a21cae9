//! Tables of names and values.

use serde_json::{Map, Value};
use std::io::Write;

/// A list of results that prints as a table or as one JSON object.
#[derive(Default)]
pub struct ResultTable {
    rows: Vec<(String, String)>,
    json: Map<String, Value>,
}

impl ResultTable {
    /// Adds a line to the table and `key` to the JSON object.
    pub fn add(
        &mut self,
        label: &str,
        text: impl Into<String>,
        key: &str,
        value: impl Into<Value>,
    ) {
        self.rows.push((label.to_owned(), text.into()));
        self.json.insert(key.to_owned(), value.into());
    }

    /// Adds to the JSON object only.
    pub fn add_value(&mut self, key: &str, value: impl Into<Value>) {
        self.json.insert(key.to_owned(), value.into());
    }

    /// Prints to standard output.
    pub fn print(self, json: bool) {
        if json {
            print_text(&format!("{}\n", Value::Object(self.json)));
            return;
        }
        print_rows(&self.rows);
    }
}

/// Prints labels and texts in two columns.
pub fn print_rows(rows: &[(String, String)]) {
    let width = rows.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
    let lines = rows.iter().map(|(label, text)| format!("{label:<width$}  {text}\n"));
    print_text(&lines.collect::<String>());
}

/// A property of a mesh that should hold, in words: the fault stands out.
pub(crate) fn yes_or_no(holds: bool) -> &'static str {
    if holds { "yes" } else { "NO" }
}

/// Prints to standard output. A reader that has seen enough, as `head` has, is no fault.
pub fn print_text(text: &str) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("puffer: cannot write to standard output: {error}");
        std::process::exit(1);
    }
}
