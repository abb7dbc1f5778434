//! A live run on one screen of a terminal.

use super::run::{said, tone, when};
use super::terminal::{Tone, wrapped};
use navfuse_core::model::record::{Event, Level};
use navfuse_live::{Estimate, SensorState, SensorStatus, StateStatus, Status};
use navfuse_observability::{Determination, words};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Paragraph, Row, Table};
use std::collections::VecDeque;
use std::time::Duration;

/// Latest events that are kept.
const EVENTS: usize = 100;
/// Age of the state of a run beyond which the screen names it: a state comes every second.
const OLD: Duration = Duration::from_secs(3);
/// Lines of the estimate, and the most lines for the verdict.
const ESTIMATE: u16 = 4;
const VERDICT: usize = 2;
/// Width to which texts are broken at least, columns: a narrower screen cuts them off.
const NARROWEST: usize = 20;
/// Widths of the titles, the sigmas and the verdicts of states that are not determined, columns.
const STATES: [u16; 3] = [22, 14, 14];
/// Least number of lines for the events, with their heading.
const LEAST: u16 = 3;

/// What the screen shows.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// The latest state of the run.
    pub status: Status,
    /// Its latest events, the last one at the end.
    pub events: VecDeque<Event>,
    /// Set once the run was asked to end.
    pub ends: bool,
}

impl View {
    /// Adds an event.
    pub fn add(&mut self, event: &Event) {
        if self.events.len() == EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event.clone());
    }
}

/// Draws a run whose state has this age.
pub fn draw(frame: &mut Frame<'_>, view: &View, age: Duration) {
    let status = &view.status;
    let open = status.states.iter().filter(|s| is_open(s)).count() as u16;
    let area = frame.area();
    let heading = heading(view, age, area.width);
    let lines = heading.len() as u16;
    let left = area.height.saturating_sub(lines + ESTIMATE + LEAST);
    let sensors = (status.sensors.len() as u16 + 1).min(left.saturating_sub(1));
    let states = (open + 1).min(left.saturating_sub(sensors));
    let [head, middle, estimate, determined, events] = Layout::vertical([
        Constraint::Length(lines),
        Constraint::Length(sensors),
        Constraint::Length(ESTIMATE),
        Constraint::Length(states),
        Constraint::Fill(1),
    ])
    .areas(area);
    frame.render_widget(Paragraph::new(heading), head);
    frame.render_widget(table_of_sensors(&status.sensors), middle);
    frame.render_widget(table_of_estimate(status), estimate);
    frame.render_widget(table_of_states(&status.states, area.width), determined);
    draw_events(frame, view, events);
}

fn heading(view: &View, age: Duration, width: u16) -> Vec<Line<'_>> {
    let status = &view.status;
    let time =
        status.time_s.map_or("no estimate yet".to_owned(), |t| format!("estimate at {t:.3} s"));
    let now = match (view.ends, age > OLD) {
        (_, true) => format!("no news for {:.0} s", age.as_secs_f64()),
        (true, _) => "ends".to_owned(),
        (false, _) => "runs, and ends by q".to_owned(),
    };
    let [median, most, largest] = status.latency_ms;
    let latency = format!("latency, ms: median {median:.3}, 99 % {most:.3}, largest {largest:.3}");
    let verdict =
        wrapped(&format!("verdict so far: {}", status.text), usize::from(width).max(NARROWEST));
    let style = colour(tone(status.verdict));
    let mut lines =
        vec![Line::from(vec![status.name.as_str().bold(), format!(": {now}; {time}").into()])];
    lines.extend(verdict.lines().take(VERDICT).map(|l| Line::styled(l.to_owned(), style)));
    lines.push(latency.into());
    lines
}

fn colour(tone: Tone) -> Style {
    match tone {
        Tone::Good => Color::Green.into(),
        Tone::Doubtful => Color::Yellow.into(),
        Tone::Bad => Style::from(Color::Red).bold(),
    }
}

/// A table; `numbers` are on the right of their columns.
fn table<'a, const N: usize>(
    headings: [Span<'a>; N],
    rows: Vec<[Span<'a>; N]>,
    widths: [Constraint; N],
    numbers: std::ops::Range<usize>,
) -> Table<'a> {
    let row = |cells: [Span<'a>; N]| {
        let cell = |(k, cell)| match numbers.contains(&k) {
            true => Line::from(cell).right_aligned(),
            false => Line::from(cell),
        };
        Row::new(cells.into_iter().enumerate().map(cell).collect::<Vec<_>>())
    };
    let head = row(headings).style(Style::new().bold().underlined());
    Table::new(rows.into_iter().map(row), widths).header(head)
}

/// A column of that width; zero is what the others leave.
fn column(width: u16) -> Constraint {
    if width == 0 { Constraint::Fill(1) } else { Constraint::Length(width) }
}

fn number(value: Option<f64>, decimals: usize) -> String {
    let value = value.filter(|value| value.is_finite());
    value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
}

fn table_of_sensors(sensors: &[SensorStatus]) -> Table<'_> {
    let row = |sensor: &SensorStatus| {
        let state = match sensor.state {
            SensorState::Used => colour(Tone::Good),
            SensorState::Waiting | SensorState::Off => Style::new(),
            SensorState::Doubted => colour(Tone::Bad),
            SensorState::Gated | SensorState::Rejected | SensorState::Silent => {
                colour(Tone::Doubtful)
            }
        };
        let share = sensor.share.map_or("-".to_owned(), |share| format!("{:.0} %", 100.0 * share));
        [
            sensor.name.clone().into(),
            Span::styled(sensor.state.word(), state),
            number(sensor.rate_hz, 1).into(),
            number(sensor.age_s, 1).into(),
            number(sensor.clock.delay_s.map(|delay| 1e3 * delay), 1).into(),
            number(sensor.nis, 1).into(),
            share.into(),
            sensor.used.to_string().into(),
            sensor.gated.to_string().into(),
            (sensor.rejected + sensor.refused).to_string().into(),
        ]
    };
    let headings =
        ["sensor", "state", "Hz", "age s", "lag ms", "NIS", "share", "used", "gated", "rejected"];
    let widths = [0, 9, 6, 5, 6, 5, 6, 8, 5, 8].map(column);
    table(headings.map(Span::from), sensors.iter().map(row).collect(), widths, 2..10)
}

fn table_of_estimate(status: &Status) -> Table<'_> {
    let Estimate { position_deg_deg_m, velocity_ned_mps, roll_pitch_heading_deg } = status.estimate;
    let sigma = &status.accuracy;
    let rows = vec![
        quantity("lat lon, height m", position_deg_deg_m, [7, 7, 2], sigma.position_m, 2),
        quantity("velocity NED m/s", velocity_ned_mps, [3; 3], sigma.velocity_mps, 3),
        quantity("roll pitch heading", roll_pitch_heading_deg, [3; 3], sigma.attitude_deg, 3),
    ];
    let headings = ["estimate", "", "", "", "1-sigma N", "E", "D"];
    let widths = [0, 11, 12, 9, 9, 7, 7].map(column);
    table(headings.map(Span::from), rows, widths, 1..7)
}

/// The row of three values and their 1-sigma, each with so many decimals.
fn quantity(
    name: &str,
    values: Option<[f64; 3]>,
    decimals: [usize; 3],
    sigmas: Option<[f64; 3]>,
    places: usize,
) -> [Span<'_>; 7] {
    let value = |k: usize| Span::from(number(values.map(|v| v[k]), decimals[k]));
    let sigma = |k: usize| Span::from(number(sigmas.map(|s| s[k]), places));
    [name.into(), value(0), value(1), value(2), sigma(0), sigma(1), sigma(2)]
}

fn is_open(state: &StateStatus) -> bool {
    matches!(state.verdict, Determination::InPart | Determination::NotDetermined)
}

fn table_of_states(states: &[StateStatus], width: u16) -> Table<'_> {
    // three spaces are between the columns
    let room = usize::from(width.saturating_sub(STATES.iter().sum::<u16>() + 3));
    let row = |state: &StateStatus| {
        let help = state.manoeuvre.as_ref().or(state.missing.as_ref());
        [
            state.title.clone().into(),
            format!("{} {}", words::short(state.sigma), state.unit).into(),
            state.verdict.text().into(),
            help.map_or_else(String::new, |help| clauses(help, room)).into(),
        ]
    };
    let determined = states.iter().filter(|s| s.verdict == Determination::Determined).count();
    let title = format!("{determined} of {} are determined", states.len());
    let headings = ["not determined yet".into(), "1-sigma".into(), "".into(), title.into()];
    let [title_width, sigma, verdict] = STATES;
    let widths = [title_width, sigma, verdict, 0].map(column);
    let rows = states.iter().filter(|s| is_open(s)).map(row).collect();
    table(headings, rows, widths, 1..2)
}

/// The clauses of a sentence that have room, or the words of the first one that have.
fn clauses(text: &str, room: usize) -> String {
    let fits = |end: &usize| text[..*end].chars().count() <= room;
    if fits(&text.len()) {
        return text.to_owned();
    }
    let ends = |mark: &'static str| text.match_indices(mark).map(|(at, _)| at);
    let clauses = [", ", "; ", ": "].into_iter().flat_map(ends).filter(fits);
    if let Some(end) = clauses.max() {
        return text[..end].to_owned();
    }
    let words = ends(" ").filter(|end| text[..*end].chars().count() < room);
    words.max().map_or_else(String::new, |end| format!("{}…", &text[..end]))
}

/// Draws the latest events that have room.
fn draw_events(frame: &mut Frame<'_>, view: &View, area: Rect) {
    let width = usize::from(area.width).max(NARROWEST);
    let mut lines = Vec::new();
    for event in &view.events {
        let style = match event.level {
            Level::Info => Style::new(),
            Level::Warning => colour(Tone::Doubtful),
            Level::Error => colour(Tone::Bad),
        };
        let text = wrapped(&format!("{}{}", when(event), said(event)), width);
        lines.extend(text.lines().map(|line| Line::styled(line.to_owned(), style)));
    }
    let room = usize::from(area.height.saturating_sub(1));
    let mut shown = vec![Line::styled("events", Style::new().bold().underlined())];
    shown.extend(lines.split_off(lines.len().saturating_sub(room)));
    frame.render_widget(Paragraph::new(shown), area);
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

    use super::*;
    use navfuse_core::model::record::verdict::VerdictLevel;
    use navfuse_core::units::time::Time;
    use navfuse_live::{Accuracy, ClockStatus};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn sensor(name: &str, state: SensorState, rate: f64, counts: [u64; 3]) -> SensorStatus {
        let [used, gated, rejected] = counts;
        let measures = name != "imu";
        SensorStatus {
            name: name.to_owned(),
            state,
            used,
            gated,
            rejected,
            nis: measures.then_some(1.04),
            share: measures.then_some(0.33),
            rate_hz: Some(rate),
            age_s: Some(0.04),
            clock: ClockStatus { delay_s: measures.then_some(0.0123), drift_ppm: None },
            ..SensorStatus::default()
        }
    }

    fn state(title: &str, sigma: f64, unit: &str, verdict: Determination) -> StateStatus {
        let (missing, manoeuvre) = match verdict {
            Determination::Determined => (None, None),
            Determination::InPart => (None, Some("turn by 90 deg".to_owned())),
            _ => (Some("no sample of dvl was used".to_owned()), None),
        };
        let (title, unit) = (title.to_owned(), unit.to_owned());
        StateStatus { title, sigma, unit, verdict, missing, manoeuvre }
    }

    /// A run with a DVL that contradicts the others.
    fn view() -> View {
        let status = Status {
            name: "dive".to_owned(),
            running: true,
            time_s: Some(1234.5),
            estimate: Estimate {
                position_deg_deg_m: Some([43.012_345_6, 5.123_456_7, -31.04]),
                velocity_ned_mps: Some([1.234, -0.567, 0.012]),
                roll_pitch_heading_deg: Some([0.12, -1.5, 330.25]),
            },
            accuracy: Accuracy {
                position_m: Some([0.52, 0.49, 0.05]),
                velocity_mps: Some([0.012, 0.013, 0.004]),
                attitude_deg: Some([0.021, 0.019, 0.52]),
            },
            states: vec![
                state("ins.attitude yaw", 0.52, "deg", Determination::Determined),
                state("ins.accel_bias x", 212.3, "ug", Determination::InPart),
                state("dvl.scale", 0.002, "", Determination::NotDetermined),
            ],
            verdict: VerdictLevel::Doubtful,
            text: "doubtful: dvl contradicts the others".to_owned(),
            sensors: vec![
                sensor("imu", SensorState::Used, 200.0, [246_900, 0, 0]),
                sensor("gnss", SensorState::Silent, 1.0, [1200, 3, 0]),
                sensor("dvl", SensorState::Doubted, 5.0, [6001, 170, 2]),
            ],
            latency_ms: [0.063, 1.413, 12.5],
            ..Status::default()
        };
        let mut view = View { status, ..View::default() };
        let event = |seconds: f64, level, about: &str, text: &str| Event {
            time: Time::from_seconds(seconds).unwrap(),
            level,
            about: about.to_owned(),
            text: text.to_owned(),
        };
        view.add(&event(1200.0, Level::Info, "gnss", "is back after 12.0 s"));
        view.add(&event(1210.2, Level::Warning, "gnss", "gnss lost: no sample for 5 s"));
        let long = "its innovations are larger than their sigma, 3.1 times in the mean of the last 200 \
                    samples, and it contradicts depth and gnss; look at its mounting";
        view.add(&event(1230.0, Level::Warning, "dvl", long));
        view
    }

    fn drawn(view: &View, width: u16, height: u16, age: Duration) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, view, age)).unwrap();
        let text = terminal.backend().to_string();
        let lines = text.lines().map(|line| line.trim_matches('"').trim_end().to_owned() + "\n");
        lines.collect()
    }

    #[test]
    fn a_run_on_80_columns_and_24_lines() {
        insta::assert_snapshot!(drawn(&view(), 80, 24, Duration::ZERO), @r"
        dive: runs, and ends by q; estimate at 1234.500 s
        verdict so far: doubtful: dvl contradicts the others
        latency, ms: median 0.063, 99 % 1.413, largest 12.500
        sensor        state         Hz age s lag ms   NIS  share     used gated rejected
        imu           used       200.0   0.0      -     -      -   246900     0        0
        gnss          silent       1.0   0.0   12.3   1.0   33 %     1200     3        0
        dvl           doubted      5.0   0.0   12.3   1.0   33 %     6001   170        2
        estimate                                               1-sigma N       E       D
        lat lon, height m    43.0123456    5.1234567    -31.04      0.52    0.49    0.05
        velocity NED m/s          1.234       -0.567     0.012     0.012   0.013   0.004
        roll pitch heading        0.120       -1.500   330.250     0.021   0.019   0.520
        not determined yet            1-sigma                1 of 3 are determined
        ins.accel_bias x               212 ug in part        turn by 90 deg
        dvl.scale                      0.002  not determined no sample of dvl was used
        events
        1200.000 s gnss: is back after 12.0 s
        1210.200 s gnss lost: no sample for 5 s
        1230.000 s dvl: its innovations are larger than their sigma, 3.1 times in the
            mean of the last 200 samples, and it contradicts depth and gnss; look at its
            mounting
        ");
    }

    #[test]
    fn a_reason_ends_with_a_clause_or_a_word_that_has_room() {
        let text = "no enabled sensor reads it; it converges slowly, against the process noise";
        let slowly = "no enabled sensor reads it; it converges slowly";
        assert_eq!(clauses(text, 80), text);
        assert_eq!(clauses(text, 60), slowly);
        assert_eq!(clauses(text, 27), "no enabled sensor reads it");
        assert_eq!(clauses(text, 20), "no enabled sensor…");
        assert_eq!(clauses(text, 1), "");
    }

    #[test]
    fn a_screen_of_any_size_shows_what_has_room() {
        for (width, height) in [(1, 1), (20, 5), (40, 10), (79, 13), (300, 100)] {
            let text = drawn(&view(), width, height, Duration::ZERO);
            assert_eq!(text.lines().count(), usize::from(height));
        }
        assert!(drawn(&View::default(), 80, 24, Duration::ZERO).contains("no estimate yet"));
    }

    #[test]
    fn a_run_that_does_not_answer_is_named() {
        let text = drawn(&view(), 80, 24, Duration::from_secs(7));
        assert!(text.contains("no news for 7 s"), "{text}");
    }
}
