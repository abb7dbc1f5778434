//! The terminal: its width, its colours, and how much is printed.

use console::{Style, Term};
use std::sync::OnceLock;

/// Smallest width to which output is fitted, columns.
const NARROWEST: usize = 40;

/// The amount of output.
static DETAIL: OnceLock<Detail> = OnceLock::new();

/// Amount of output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detail {
    /// Results, a line for each, and errors.
    Quiet,
    /// Results, progress, and the first warnings.
    #[default]
    Usual,
    /// All warnings, and the notes of a run as it goes on.
    Verbose,
}

impl Detail {
    /// Sets the amount of output of the process, once.
    pub fn set(self) {
        DETAIL.set(self).ok();
    }

    /// The amount of output of the process.
    pub fn get() -> Self {
        DETAIL.get().copied().unwrap_or_default()
    }

    /// True if results alone are printed.
    pub fn is_quiet() -> bool {
        Self::get() == Self::Quiet
    }
}

/// Stream that is printed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Standard output.
    Output,
    /// Standard error.
    Error,
}

impl Stream {
    /// The width that output is fitted to: of the terminal, or for output that goes elsewhere what
    /// the variable `COLUMNS` gives, or the width of the terminal that shows the other stream, as
    /// with a pager; none where all are missing.
    pub fn width(self) -> Option<usize> {
        let (own, other) = match self {
            Self::Output => (Term::stdout(), Term::stderr()),
            Self::Error => (Term::stderr(), Term::stdout()),
        };
        let width = |term: &Term| term.size_checked().map(|(_, columns)| usize::from(columns));
        let columns = || std::env::var("COLUMNS").ok()?.parse().ok();
        width(&own).or_else(columns).or_else(|| width(&other)).map(|width| width.max(NARROWEST))
    }
}

/// Meaning of a word that has a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Nothing contradicts the result.
    Good,
    /// An engineer should look.
    Doubtful,
    /// The result is wrong, or there is none.
    Bad,
}

impl Tone {
    /// The text in the colour of the tone, where the stream shows colours. `NO_COLOR`, `CLICOLOR` and
    /// `CLICOLOR_FORCE` are respected.
    pub fn paint(self, text: &str, stream: Stream) -> String {
        let style = match self {
            Self::Good => Style::new().green(),
            Self::Doubtful => Style::new().yellow(),
            Self::Bad => Style::new().red().bold(),
        };
        let style = if stream == Stream::Error { style.for_stderr() } else { style };
        style.apply_to(text).to_string()
    }
}

/// A text with no line longer than `width`, broken at spaces. Later lines of a broken one are
/// indented. Words are kept whole.
pub fn wrapped(text: &str, width: usize) -> String {
    const INDENT: usize = 4;
    let mut out = Vec::new();
    for line in text.split('\n') {
        let mut rest = line;
        let mut indent = 0;
        while rest.chars().count() + indent > width {
            let end = rest.char_indices().nth(width - indent + 1).map_or(rest.len(), |(at, _)| at);
            let start = rest.len() - rest.trim_start().len();
            let at_space = rest[..end].rfind(' ').filter(|at| *at > start);
            let Some(at) = at_space.or_else(|| rest[end..].find(' ').map(|at| end + at)) else {
                break;
            };
            out.push(format!("{:indent$}{}", "", rest[..at].trim_end()));
            rest = rest[at..].trim_start();
            indent = INDENT;
        }
        out.push(format!("{:indent$}{rest}", ""));
    }
    out.join("\n")
}

#[cfg(test)]
mod tests {
    use super::wrapped;

    #[test]
    fn lines_break_at_spaces_and_words_stay_whole() {
        let text = "dvl: 1.2345678 times their reported sigma\nshort\n  a-word-that-is-too-long b";
        let expected = "dvl: 1.2345678 times\n    their reported\n    sigma\nshort\n  \
                        a-word-that-is-too-long\n    b";
        assert_eq!(wrapped(text, 20), expected);
        assert_eq!(wrapped("", 20), "");
        assert_eq!(wrapped("exactly twenty chars", 20), "exactly twenty chars");
    }
}
