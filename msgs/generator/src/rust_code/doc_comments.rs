//! Documentation lines of the generated code.

/// Writes the lines as `///` comments; if there are none, the replacement.
pub(super) fn write(out: &mut String, indent: &str, lines: &[String], replacement: &str) {
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    let has_text = lines.iter().any(|line| !line.is_empty());
    let all = if has_text {
        lines.iter().map(|line| plain(line)).collect()
    } else {
        vec![replacement.to_string()]
    };
    for line in all {
        out.push_str(indent);
        out.push_str(format!("/// {line}").trim_end());
        out.push('\n');
    }
}

/// The text such that Markdown shows it as it is.
fn plain(line: &str) -> String {
    let words = line.split(' ').map(|word| {
        let is_address = word.starts_with("http://") || word.starts_with("https://");
        if is_address { format!("<{word}>") } else { escaped(word) }
    });
    words.collect::<Vec<_>>().join(" ")
}

fn escaped(word: &str) -> String {
    let mut out = String::new();
    for sign in word.chars() {
        if "\\[]<>*`".contains(sign) {
            out.push('\\');
        }
        out.push(sign);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(lines: &[&str]) -> String {
        let lines: Vec<String> = lines.iter().map(|line| (*line).to_owned()).collect();
        let mut out = String::new();
        write(&mut out, "  ", &lines, "Nothing.");
        out
    }

    #[test]
    fn signs_of_markdown_are_escaped_and_addresses_are_links() {
        assert_eq!(written(&["a[3] <= *b* `c`"]), "  /// a\\[3\\] \\<= \\*b\\* \\`c\\`\n");
        let link = written(&["see https://ros.org/a_b"]);
        assert_eq!(link, "  /// see <https://ros.org/a_b>\n");
    }

    #[test]
    fn an_entry_without_text_gets_the_replacement() {
        assert_eq!(written(&[]), "  /// Nothing.\n");
        assert_eq!(written(&["", ""]), "  /// Nothing.\n");
        assert_eq!(written(&["a", "", "b"]), "  /// a\n  ///\n  /// b\n");
    }
}
