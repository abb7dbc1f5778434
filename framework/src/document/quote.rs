//! Texts and keys as TOML writes them.

/// A text as a string of TOML, in quotes.
pub fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => out.push_str(&format!("\\u{:04X}", u32::from(c))),
            _ => out.push(c),
        }
    }
    out.push('"');
    out
}

/// A name as a key of TOML, in quotes where it needs them.
pub fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
    if !name.is_empty() && name.chars().all(bare) { name.to_owned() } else { quoted(name) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn toml_reads_every_text_and_key_as_it_was(text in any::<String>(), name in any::<String>()) {
            let line = format!("{} = {}", key(&name), quoted(&text));
            let read: toml::Table = line.parse().unwrap();
            prop_assert_eq!(read.get(&name).and_then(|value| value.as_str()), Some(text.as_str()));
        }
    }

    /// Rust's own quotation writes an accent that combines as an escape that TOML does not know.
    #[test]
    fn a_letter_with_a_combining_accent_stays_as_it_is() {
        assert_eq!(quoted("Mu\u{308}ller"), "\"Mu\u{308}ller\"");
        assert_eq!(
            [key("dvl"), key("gnss aft"), key("a.1"), key("")],
            ["dvl", "\"gnss aft\"", "\"a.1\"", "\"\""]
        );
    }
}
