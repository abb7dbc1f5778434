//! Services of ROS 2: a request, and its answer.
//!
//! The middleware pairs a request with its answer: Fast DDS by the identity of the sample, and Cyclone DDS by
//! 16 bytes before the content.

use crate::lifecycle::{Lifecycle, State, Transition};
use crate::names::{of_service, of_type};
use crate::port::{Node, Server};
use navfuse_core::model::record::Level;
use navfuse_core::model::stream::{Command, StreamError};
use navfuse_core::units::sample::SensorId;
use navfuse_links::Remark;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::task::Waker;

/// Size of the encapsulation before the body of a message.
const ENCAPSULATION: usize = 4;
/// Size of the identity that Cyclone DDS writes before the content: a client, and the number of its request.
const IDENTITY: usize = 16;
/// Bytes that may follow the content, so that its length is a multiple of four.
const PADDING: usize = 3;
/// Numbers of a pose with its covariance: position, quaternion, and six rows of six.
const POSE: usize = 8 * (3 + 4 + 36);

/// What a service does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// `std_srvs/srv/Trigger`.
    Trigger(Command),
    /// `std_srvs/srv/SetBool`: a sensor off or on.
    Use(SensorId),
    /// `lifecycle_msgs/srv/ChangeState`.
    ChangeState,
    /// `lifecycle_msgs/srv/GetState`.
    GetState,
    /// `lifecycle_msgs/srv/GetAvailableStates`.
    States,
    /// `lifecycle_msgs/srv/GetAvailableTransitions`: from the state (`false`), or all of them.
    Transitions(bool),
    /// `robot_localization/srv/SetPose`: a message of the topic of this number.
    SetPose(usize),
}

impl Task {
    fn kind(self) -> &'static str {
        match self {
            Self::Trigger(_) => "std_srvs/srv/Trigger",
            Self::Use(_) => "std_srvs/srv/SetBool",
            Self::ChangeState => "lifecycle_msgs/srv/ChangeState",
            Self::GetState => "lifecycle_msgs/srv/GetState",
            Self::States => "lifecycle_msgs/srv/GetAvailableStates",
            Self::Transitions(_) => "lifecycle_msgs/srv/GetAvailableTransitions",
            Self::SetPose(_) => "robot_localization/srv/SetPose",
        }
    }

    /// Length of the content of a request that begins here; `None` where it is cut off.
    fn length(self, content: &[u8], little: bool) -> Option<usize> {
        let text = |at: usize| {
            let bytes = *content.get(at..)?.first_chunk::<4>()?;
            let length = if little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) };
            at.checked_add(4)?.checked_add(usize::try_from(length).ok()?)
        };
        match self {
            // a byte without a meaning, or that of `data`
            Self::Trigger(_) | Self::Use(_) | Self::GetState | Self::States => Some(1),
            Self::Transitions(_) => Some(1),
            // a number and a label
            Self::ChangeState => text(4),
            // the stamp, the frame and the pose
            Self::SetPose(_) => Some(text(8)?.checked_next_multiple_of(8)? + POSE),
        }
    }
}

/// The services of a link.
pub struct Services {
    all: Vec<(String, Task, Server)>,
    /// Set where the scenario lets the link command the run.
    may: bool,
    lifecycle: Arc<Lifecycle>,
}

impl Services {
    /// Offers the services of a run with these sensors, and `SetPose` for these topics by their number.
    pub fn offer(
        node: &Node,
        sensors: &[String],
        poses: &[String],
        may: bool,
        lifecycle: Arc<Lifecycle>,
    ) -> Result<Self, StreamError> {
        let mut tasks: Vec<(String, Task)> = [
            ("reset", Task::Trigger(Command::Reset)),
            ("checkpoint", Task::Trigger(Command::Checkpoint)),
            ("change_state", Task::ChangeState),
            ("get_state", Task::GetState),
            ("get_available_states", Task::States),
            ("get_available_transitions", Task::Transitions(false)),
            ("get_transition_graph", Task::Transitions(true)),
        ]
        .map(|(name, task)| (format!("/navfuse/{name}"), task))
        .to_vec();
        // a name of ROS 2 has letters, digits and underscores
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        for (k, sensor) in sensors.iter().enumerate() {
            let name: String = sensor.chars().map(plain).collect();
            tasks.push((format!("/navfuse/enable_{name}"), Task::Use(SensorId(k))));
        }
        tasks.extend(poses.iter().enumerate().map(|(k, topic)| (topic.clone(), Task::SetPose(k))));
        let open = |(name, task): (String, Task)| {
            let topics = of_service(&name);
            let types =
                ["Request", "Response"].map(|part| of_type(&format!("{}_{part}", task.kind())));
            let server = node.serve([&topics[0], &types[0]], [&topics[1], &types[1]])?;
            Ok((name, task, server))
        };
        let all = tasks.into_iter().map(open).collect::<Result<_, StreamError>>()?;
        Ok(Self { all, may, lifecycle })
    }

    /// Answers the requests that are there, and passes their commands on. Returns the poses that are set,
    /// each with the number of its topic, as a message in CDR with its encapsulation.
    pub fn answer(&self, waker: &Waker, to: &Sender<Remark>) -> Vec<(usize, Vec<u8>)> {
        let mut poses = Vec::new();
        for (name, task, server) in &self.all {
            // before the requests, so that none is overlooked
            server.wake(waker);
            while let Some((request, asker)) = server.take() {
                let Some((identity, content)) = parse(*task, &request) else { continue };
                let mut answer = Answer::to(identity);
                let remark = match *task {
                    Task::SetPose(topic) => {
                        poses.push((topic, [&request[..ENCAPSULATION], content].concat()));
                        answer.byte(0);
                        None
                    }
                    Task::Trigger(command) => Some(self.command(name, command, &mut answer)),
                    Task::Use(sensor) => {
                        let used = content.first().is_some_and(|byte| *byte != 0);
                        Some(self.command(name, Command::Use(sensor, used), &mut answer))
                    }
                    Task::ChangeState => self.change(name, content, &mut answer),
                    Task::GetState => {
                        answer.state(self.lifecycle.state());
                        None
                    }
                    Task::States => {
                        answer.count(State::ALL.len());
                        State::ALL.into_iter().for_each(|state| answer.state(state));
                        None
                    }
                    Task::Transitions(all) => {
                        let state = self.lifecycle.state();
                        let listed = Transition::ALL.into_iter();
                        answer.transitions(listed.filter(|t| all || t.start == state).collect());
                        None
                    }
                };
                server.answer(asker, &answer.0);
                // the feed that takes it ends with this link
                if let Some(remark) = remark {
                    to.send(remark).ok();
                }
            }
        }
        poses
    }

    /// Passes a command on, or refuses it.
    fn command(&self, name: &str, command: Command, answer: &mut Answer) -> Remark {
        let (message, remark) = match self.may {
            true => (
                "passed to the run; /diagnostics and its log have the outcome",
                Remark::Command(command),
            ),
            false => (REFUSED, refused(name)),
        };
        answer.byte(u8::from(self.may));
        answer.text(message);
        remark
    }

    /// Changes the state of the node, or refuses to. `cleanup` resets the run.
    fn change(&self, name: &str, content: &[u8], answer: &mut Answer) -> Option<Remark> {
        let id = content.first().copied().unwrap_or_default();
        let label = content.get(8..).unwrap_or_default();
        let label: Vec<u8> = label.iter().copied().take_while(|byte| *byte != 0).collect();
        let label = String::from_utf8_lossy(&label);
        let asked = Transition::asked(self.lifecycle.state(), id, &label);
        let granted = asked.filter(|_| self.may);
        answer.byte(u8::from(granted.is_some()));
        match granted {
            None if !self.may => Some(refused(name)),
            None => Some(Remark::Report(
                Level::Warning,
                format!(
                    "{name}: no transition {id} {label:?} leaves the state {:?}",
                    self.lifecycle.state().label()
                ),
            )),
            Some(transition) => {
                self.lifecycle.enter(transition.goal);
                Some(match transition.goal {
                    State::Unconfigured => Remark::Command(Command::Reset),
                    state => Remark::Report(
                        Level::Info,
                        format!("{name}: {}, now {}", transition.label, state.label()),
                    ),
                })
            }
        }
    }
}

/// The answer to a command that the scenario does not allow.
const REFUSED: &str = "commands are refused: set commands = true in the link";

fn refused(name: &str) -> Remark {
    Remark::Report(Level::Warning, format!("{name}: {REFUSED}"))
}

/// The identity of a request in little endian, where it has one, and its content.
fn parse(task: Task, request: &[u8]) -> Option<(Option<[u8; IDENTITY]>, &[u8])> {
    let little = *request.get(1)? == 1;
    let body = request.get(ENCAPSULATION..)?;
    let fits = |content: &[u8]| {
        let rest = task.length(content, little).and_then(|n| content.len().checked_sub(n));
        rest.is_some_and(|rest| rest <= PADDING)
    };
    if fits(body) {
        return Some((None, body));
    }
    let (identity, content) = body.split_first_chunk::<IDENTITY>()?;
    let mut identity = *identity;
    if !little {
        identity.chunks_exact_mut(8).for_each(<[u8]>::reverse);
    }
    fits(content).then_some((Some(identity), content))
}

/// An answer in CDR with its encapsulation.
struct Answer(Vec<u8>);

impl Answer {
    /// An answer to a client.
    fn to(identity: Option<[u8; IDENTITY]>) -> Self {
        let mut out = vec![0, 1, 0, 0];
        out.extend(identity.iter().flatten());
        Self(out)
    }

    fn byte(&mut self, byte: u8) {
        self.0.push(byte);
    }

    /// A length, at a multiple of four.
    fn count(&mut self, count: usize) {
        self.0.resize(self.0.len().next_multiple_of(4), 0);
        self.0.extend((count as u32).to_le_bytes());
    }

    /// A text: its length, its bytes, and a zero.
    fn text(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    fn state(&mut self, state: State) {
        self.byte(state as u8);
        self.text(state.label());
    }

    fn transitions(&mut self, all: Vec<Transition>) {
        self.count(all.len());
        for transition in all {
            self.byte(transition.id);
            self.text(transition.label);
            self.state(transition.start);
            self.state(transition.goal);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAG: Task = Task::Use(SensorId(0));

    #[test]
    fn requests_of_both_middlewares_are_read_in_both_orders_of_bytes() {
        let identity: [u8; 16] = std::array::from_fn(|k| k as u8);
        // Fast DDS pads to four bytes
        assert_eq!(parse(FLAG, &[0, 1, 0, 3, 1, 0, 0, 0]), Some((None, &[1, 0, 0, 0][..])));
        assert_eq!(parse(FLAG, &[0, 1, 0, 0, 0]), Some((None, &[0][..])));
        let little = [&[0, 1, 0, 0][..], &identity, &[1]].concat();
        assert_eq!(parse(FLAG, &little), Some((Some(identity), &[1][..])));
        let mut swapped = identity;
        swapped.chunks_exact_mut(8).for_each(<[u8]>::reverse);
        let big = [&[0, 0, 0, 0][..], &swapped, &[0]].concat();
        assert_eq!(parse(FLAG, &big), Some((Some(identity), &[0][..])));
        for cut in [&big[..0], &big[..4], &big[..20]] {
            assert_eq!(parse(FLAG, cut), None, "{cut:?}");
        }
    }

    /// A transition with a label, and a pose, are longer than an identity.
    #[test]
    fn a_long_request_is_told_from_one_with_an_identity_by_its_length() {
        let label = [&[3, 0, 0, 0, 9, 0, 0, 0][..], b"activate\0"].concat();
        let frame = [&[0; 8][..], &[4, 0, 0, 0], b"map\0", &[0; POSE]].concat();
        for (task, content) in [(Task::ChangeState, label), (Task::SetPose(0), frame)] {
            let plain = [&[0, 1, 0, 0][..], &content].concat();
            assert_eq!(parse(task, &plain), Some((None, &content[..])));
            let named = [&[0, 1, 0, 0][..], &[7; IDENTITY], &content].concat();
            assert_eq!(parse(task, &named), Some((Some([7; IDENTITY]), &content[..])));
            assert_eq!(parse(task, &named[..named.len() - 4]), None);
        }
        // a length that reaches beyond any memory
        let endless = [&[0, 1, 0, 0][..], &[0; 4], &[0xff; 4]].concat();
        assert_eq!(parse(Task::ChangeState, &endless), None);
    }

    #[test]
    fn an_answer_is_in_cdr() {
        let mut answer = Answer::to(None);
        answer.byte(1);
        answer.text("ok");
        assert_eq!(answer.0, [0, 1, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, b'o', b'k', 0]);
        let mut answer = Answer::to(Some([7; 16]));
        answer.state(State::Active);
        let content = [&[3, 0, 0, 0, 7, 0, 0, 0][..], b"active\0"].concat();
        assert_eq!(answer.0[4..], [&[7; 16][..], &content].concat());
    }
}
