//! YAML, which is refused by name.

/// Number of lines that are looked at, and the share of them that must look like YAML.
const LINES: usize = 200;
const SHARE: f64 = 0.9;

/// Tests whether a line is a key with or without a value, an element of a list, or a separator.
fn is_line(line: &str) -> bool {
    let text = line.trim();
    let element = text.strip_prefix("- ").unwrap_or(text);
    let key = |c: char| c.is_ascii_alphanumeric() || "_-. \"'".contains(c);
    let keyed = element.split_once(':').is_some_and(|(name, value)| {
        let named = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_' || c == '"');
        named && name.chars().all(key) && (value.is_empty() || value.starts_with(' '))
    });
    text == "---" || text.starts_with('#') || keyed || text.starts_with("- ")
}

/// Tests whether a text is YAML: nearly all lines are keys, and it is a list, or has several documents.
pub fn is_yaml(text: &str) -> bool {
    let lines = || text.lines().filter(|line| !line.trim().is_empty()).take(LINES);
    let count = lines().count();
    let structured = lines().filter(|line| line.starts_with("- ") || line.trim() == "---").count();
    let fits = lines().filter(|line| is_line(line)).count() as f64;
    structured > 0 && count > 3 && fits >= SHARE * count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_documents_are_yaml_and_tables_are_not() {
        assert!(is_yaml(
            "- time: 0.01\n  gyro: [0.1, 0.2, 0.3]\n- time: 0.02\n  gyro: [0, 0, 1]\n"
        ));
        assert!(is_yaml("header:\n  stamp:\n    sec: 1\nw:\n  x: 0.1\n---\nheader:\n  sec: 2\n"));
        assert!(!is_yaml("time,gx\n0.01,2\n0.02,3\n0.03,4\n0.04,5\n"));
        assert!(!is_yaml("t: 0.01 gx: 0.2 gy: 0.3\nt: 0.02 gx: 0.2 gy: 0.3\n"));
    }
}
