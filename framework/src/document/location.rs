//! The place of a value.

use std::fmt;

/// The place of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Location {
    /// A line of a file.
    File {
        /// The file as it was named.
        name: String,
        /// The line, counted from 1.
        line: usize,
        /// The line's text with the part that the location means; none for a whole file.
        excerpt: Option<Box<Excerpt>>,
    },
    /// An override on the command line.
    Set {
        /// The key path that was set.
        path: String,
    },
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { name, line, .. } => write!(f, "{name}:{line}"),
            Self::Set { path } => write!(f, "--set {path}"),
        }
    }
}

/// A line of a text, and a part of it. Printed, carets mark the part:
///
/// ```text
///    |
/// 36 | gaet = 0.999
///    | ^^^^
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Excerpt {
    /// The line, counted from 1.
    pub line: usize,
    /// The text of the line, without its end.
    pub text: String,
    /// Number of characters before the part.
    pub before: usize,
    /// Number of characters of the part, at least one.
    pub length: usize,
}

impl Excerpt {
    /// Largest number of characters of a line that are printed.
    const SHOWN: usize = 160;

    /// The excerpt of a text at a range of bytes. A part of several lines is cut at the end of the
    /// first one.
    pub(super) fn of(text: &str, range: std::ops::Range<usize>) -> Self {
        let before = text.get(..range.start).unwrap_or(text);
        let begin = before.rfind('\n').map_or(0, |at| at + 1);
        let whole = text.get(begin..).and_then(|rest| rest.lines().next()).unwrap_or_default();
        let part = text.get(range).and_then(|part| part.lines().next()).unwrap_or_default();
        Self {
            line: before.matches('\n').count() + 1,
            text: whole.to_owned(),
            before: before[begin..].chars().count(),
            length: part.trim_end().chars().count().max(1),
        }
    }

    /// The column, counted from 1.
    pub fn column(&self) -> usize {
        self.before + 1
    }
}

impl fmt::Display for Excerpt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // a long line is cut to the marked part and its surroundings
        let left = self.before.saturating_sub(Self::SHOWN / 2);
        let shown = self.text.chars().skip(left).take(Self::SHOWN);
        let shown: String = shown.map(|c| if c == '\t' { ' ' } else { c }).collect();
        let number = self.line.to_string();
        let margin = " ".repeat(number.len());
        let indent = " ".repeat(self.before - left);
        let carets = "^".repeat(self.length.min(Self::SHOWN));
        writeln!(f, "{margin} |")?;
        writeln!(f, "{number} | {}", shown.trim_end())?;
        write!(f, "{margin} | {indent}{carets}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The part of ten characters in the middle of 1000 has 80 characters before it.
    #[test]
    fn a_long_line_is_printed_around_its_part() {
        let text = format!("{}0123456789{}", "a".repeat(495), "b".repeat(495));
        let printed = Excerpt::of(&text, 495..505).to_string();
        let lines: Vec<&str> = printed.lines().collect();
        assert_eq!(lines[1], format!("1 | {}0123456789{}", "a".repeat(80), "b".repeat(70)));
        assert_eq!(lines[2], format!("  | {}{}", " ".repeat(80), "^".repeat(10)));
    }

    #[test]
    fn a_short_line_is_printed_whole() {
        let printed = Excerpt::of("x = 1\n\ty = 2", 11..12).to_string();
        assert_eq!(printed, "  |\n2 |  y = 2\n  |      ^");
    }
}
