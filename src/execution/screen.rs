//! The terminal of a live run, on a thread of its own: a terminal that stands still does not hold the
//! run, and the terminal is as it was before on every way out.

use crate::error::{CommandError, Result};
use crate::output::dashboard::{View, draw};
use navfuse_core::model::record::Event;
use navfuse_live::Status;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event as Input, KeyCode, KeyEventKind, KeyModifiers};
use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::Builder;
use std::time::{Duration, Instant};

/// Time after which the thread looks for keys and for a new state.
const LOOK: Duration = Duration::from_millis(100);
/// Time after which it draws without a new state: the age of the last one grows.
const AGAIN: Duration = Duration::from_secs(1);
/// Longest wait for a terminal that stands still, at the end.
const PATIENCE: Duration = Duration::from_secs(1);

/// What the run and the thread share.
struct Shared {
    view: Mutex<(View, Instant)>,
    /// Set with each change of the view.
    changed: AtomicBool,
    /// Set once nothing more is drawn.
    over: AtomicBool,
    /// Held while something is drawn.
    drawing: Mutex<()>,
}

impl Shared {
    fn view(&self) -> MutexGuard<'_, (View, Instant)> {
        // a view is a view, whatever happened to a thread that held it
        self.view.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Draws nothing from now on, and waits for what is being drawn.
    fn end(&self) {
        self.over.store(true, Ordering::SeqCst);
        let begin = Instant::now();
        while self.drawing.try_lock().is_err() && begin.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// The screen; dropping it restores the terminal.
pub struct Screen {
    shared: Arc<Shared>,
    /// Ends with the thread.
    ended: Receiver<()>,
}

impl Screen {
    /// Takes the terminal over for a run of that name; the keys q and Ctrl-C set `stop`.
    ///
    /// # Errors
    /// Where standard output is no terminal.
    pub fn open(name: String, stop: Arc<AtomicBool>) -> Result<Self> {
        let refuse = |why: &str| {
            let remedy = "leave it out, and look at the run with `navfuse status`";
            CommandError::argument("--tui", format!("{why}; {remedy}"))
        };
        if !io::stdout().is_terminal() {
            return Err(refuse("standard output is no terminal"));
        }
        let status = Status { name, ..Status::default() };
        let view = View { status, ..View::default() };
        let shared = Arc::new(Shared {
            view: Mutex::new((view, Instant::now())),
            changed: AtomicBool::new(true),
            over: AtomicBool::new(false),
            drawing: Mutex::new(()),
        });
        // ratatui restores the terminal before a panic is printed; the thread must not draw after that
        let terminal = ratatui::try_init().map_err(|e| {
            ratatui::try_restore().ok();
            refuse(&format!("the terminal cannot be used: {e}"))
        })?;
        let (before, seen) = (std::panic::take_hook(), Arc::clone(&shared));
        std::panic::set_hook(Box::new(move |panic| {
            seen.end();
            before(panic);
        }));
        let (alive, ended) = channel();
        let screen = Self { shared: Arc::clone(&shared), ended };
        let work = move || {
            // a terminal that is gone ends the thread, and not the run
            show(terminal, &shared, &stop).ok();
            drop(alive);
        };
        let thread = Builder::new().name("screen".to_owned()).spawn(work);
        thread.map_err(|e| refuse(&format!("the system gives no thread: {e}")))?;
        Ok(screen)
    }

    /// Shows a state of the run.
    pub fn status(&self, status: &Status) {
        let mut view = self.shared.view();
        view.0.status.clone_from(status);
        view.1 = Instant::now();
        drop(view);
        self.shared.changed.store(true, Ordering::Relaxed);
    }

    /// Shows an event.
    pub fn event(&self, event: &Event) {
        self.shared.view().0.add(event);
        self.shared.changed.store(true, Ordering::Relaxed);
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.shared.end();
        self.ended.recv_timeout(PATIENCE).ok();
        // nothing can be done about a terminal that is gone
        ratatui::try_restore().ok();
    }
}

/// Draws until the end, and reads the keys.
fn show(mut terminal: DefaultTerminal, shared: &Shared, stop: &AtomicBool) -> io::Result<()> {
    let mut drawn = Instant::now();
    while !shared.over.load(Ordering::SeqCst) {
        if shared.changed.swap(false, Ordering::Relaxed) || drawn.elapsed() >= AGAIN {
            drawn = Instant::now();
            let (view, at) = shared.view().clone();
            let _drawing = shared.drawing.lock().unwrap_or_else(PoisonError::into_inner);
            if !shared.over.load(Ordering::SeqCst) {
                terminal.draw(|frame| draw(frame, &view, at.elapsed()))?;
            }
        }
        if event::poll(LOOK)? {
            if ends(&event::read()?) {
                stop.store(true, Ordering::Relaxed);
                shared.view().0.ends = true;
            }
            // a resized terminal, too
            shared.changed.store(true, Ordering::Relaxed);
        }
    }
    Ok(())
}

/// Tests for the keys q and Ctrl-C.
fn ends(input: &Input) -> bool {
    let Input::Key(key) = input else { return false };
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    key.kind == KeyEventKind::Press
        && (key.code == KeyCode::Char('q') || control && key.code == KeyCode::Char('c'))
}

#[cfg(all(test, unix))]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic, reason = "a test ends where it fails")]

    use super::*;
    use navfuse_testing::absent::{Need, skip};
    use std::process::{Command, Stdio};

    #[test]
    #[ignore = "the next test runs it on a pseudo-terminal"]
    fn a_plugin_panics() {
        let screen = Screen::open("dive".to_owned(), Arc::default()).unwrap();
        screen.status(&Status { text: "not judged".to_owned(), ..Status::default() });
        std::thread::sleep(5 * LOOK);
        panic!("a plugin is wrong");
    }

    #[test]
    fn a_panic_is_printed_on_the_terminal_as_it_was_before() {
        let folder = tempfile::tempdir().unwrap();
        let [before, after] = ["before", "after"].map(|name| folder.path().join(name));
        let test = "execution::screen::tests::a_plugin_panics";
        let line = format!(
            "stty cols 80 rows 24; stty -a > '{}'; '{}' --ignored --exact --nocapture {test}; stty -a > '{}'",
            before.display(),
            std::env::current_exe().unwrap().display(),
            after.display()
        );
        let mut script = Command::new("script");
        script.args(["-qec", &line, "/dev/null"]).env("TERM", "xterm").stdin(Stdio::null());
        let Ok(output) = script.output() else {
            return skip(Need::Unix, "`script`, which makes the pseudo-terminal");
        };
        let shown = String::from_utf8_lossy(&output.stdout).into_owned();
        let (on_screen, rest) =
            shown.split_once("\u{1b}[?1049l").unwrap_or_else(|| panic!("{shown}"));
        assert!(on_screen.contains("\u{1b}[?1049h") && on_screen.contains("judged"), "{shown}");
        assert!(!on_screen.contains("a plugin is wrong"), "{shown}");
        assert!(rest.contains("a plugin is wrong"), "{shown}");
        let setting = |path| std::fs::read_to_string(path).unwrap();
        assert_eq!(setting(before), setting(after));
    }
}
