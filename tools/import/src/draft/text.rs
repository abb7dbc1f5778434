//! The text of a scenario while it is written.

/// The mark of a line whose value the files do not give.
pub const MARK: &str = "# ANSWER:";

/// The comment on a heading that was answered.
pub const AS_ANSWERED: &str = "# with the heading as answered";

/// The text while it is written, and its questions.
#[derive(Default)]
pub struct Text {
    pub text: String,
    pub questions: Vec<String>,
    /// Set if the heading at the start is too uncertain for one linearisation.
    pub wide: bool,
    /// Set if the heading counts from the one at the start.
    pub relative: bool,
    /// Set if an alignment at rest finds north by the gyros.
    pub aligned_at_rest: bool,
    /// Set if an alignment at rest or in motion does.
    pub finds_north: bool,
    /// Other answers to a question, between which the samples decide.
    pub alternatives: Vec<String>,
    /// Time at which the alignment begins, s, if not at the first sample.
    pub begin: Option<f64>,
}

impl Text {
    pub fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// A line whose value the files do not give.
    pub fn ask(&mut self, line: &str, question: &str) {
        self.line(&format!("{line:<44} {MARK} {question}"));
        let mut tables = self.text.lines().filter(|l| l.starts_with('['));
        let table = tables.next_back().unwrap_or_default().trim_matches(['[', ']']).to_owned();
        let key = line.split(" =").next().unwrap_or_default();
        self.questions.push(format!("{table}: {key}: {question}"));
    }
}

/// Removes what would end a comment.
pub fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// A number with two digits that are significant.
pub fn round(value: f64) -> f64 {
    if value <= 0.0 || !value.is_finite() {
        return 0.001;
    }
    let digit = 10_f64.powf(value.log10().floor() - 1.0);
    let rounded = (value / digit).round() * digit;
    format!("{rounded:.6}").parse().unwrap_or(rounded).max(1e-6)
}
