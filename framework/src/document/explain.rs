//! Rewords the messages of serde, and suggests the word that was meant.

/// The allowed word nearest to the one found, if any is near.
pub fn did_you_mean<'a>(
    found: &str,
    allowed: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    // a less similar suggestion confuses: "gaet" scores 0.75 against "gate",
    // and "dge" scores 0.67 against "deg"
    const NEAR: f64 = 0.6;
    let lower = found.to_lowercase();
    let score = |word: &str| {
        // of two equal scores, the word in the same case wins
        strsim::normalized_damerau_levenshtein(&lower, &word.to_lowercase())
            + 1e-3 * strsim::normalized_damerau_levenshtein(found, word)
    };
    let scored = allowed.into_iter().map(|word| (word, score(word))).filter(|(_, s)| *s >= NEAR);
    scored
        .fold(None, |best: Option<(&str, f64)>, next| match best {
            Some(b) if b.1 >= next.1 => best,
            _ => Some(next),
        })?
        .0
        .into()
}

/// `unknown key "gaet"; did you mean "gate"? (allowed: gate, noise)`.
pub fn unknown(what: &str, found: &str, allowed: &[&str]) -> String {
    let near = did_you_mean(found, allowed.iter().copied())
        .map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
    let list = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
    format!("unknown {what} {found:?}{near} (allowed: {list})")
}

/// A message of serde, parsed.
#[derive(Debug, PartialEq)]
pub enum Complaint<'a> {
    /// A key that the type does not have, and the keys that it has.
    UnknownKey { key: &'a str, allowed: Vec<&'a str> },
    /// A key that the type needs and the table does not have.
    MissingKey(&'a str),
    /// Any other message, reworded.
    Other(String),
}

/// Parses a message of serde or of its derived code; `found` is the kind of the value concerned.
pub fn complaint<'a>(message: &'a str, found: &str) -> Complaint<'a> {
    // the words in backquotes
    let quoted = |list: &'a str| list.split('`').skip(1).step_by(2).collect::<Vec<_>>();
    if let Some((key, rest)) =
        message.strip_prefix("unknown field `").and_then(|m| m.split_once("`, "))
    {
        return Complaint::UnknownKey { key, allowed: quoted(rest) };
    }
    if let Some((word, rest)) =
        message.strip_prefix("unknown variant `").and_then(|m| m.split_once("`, "))
    {
        return Complaint::Other(unknown("value", word, &quoted(rest)));
    }
    if let Some(key) = message.strip_prefix("missing field `").and_then(|m| m.strip_suffix('`')) {
        return Complaint::MissingKey(key);
    }
    let expecting =
        |prefix| message.strip_prefix(prefix).and_then(|m: &str| m.split_once(", expected "));
    Complaint::Other(if let Some((_, expected)) = expecting("invalid type: ") {
        format!("found {found}, expected {}", plainly(expected))
    } else if let Some((_, expected)) = expecting("invalid value: ") {
        format!("expected {}", plainly(expected))
    } else if let Some((length, expected)) = expecting("invalid length ") {
        format!("found {length} of them, expected {}", plainly(expected))
    } else {
        message.to_owned()
    })
}

/// The value that serde expects, without the names of Rust types.
fn plainly(expected: &str) -> &str {
    match expected {
        "f32" | "f64" => "a number",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, not negative",
        "a boolean" => "true or false",
        "a sequence" => "an array",
        "a map" => "a table",
        structure if structure.starts_with("struct ") => "a table",
        other => other,
    }
}
