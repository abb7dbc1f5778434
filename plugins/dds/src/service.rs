//! Services of ROS 2 that command the run: a request, and its answer.
//!
//! A request of `std_srvs/srv/Trigger` has one byte without a meaning, and one of `std_srvs/srv/SetBool` the
//! byte of its `data`. Both are answered with `success` and `message`. The middleware pairs a request with its
//! answer: Fast DDS by the identity of the sample, and Cyclone DDS by 16 bytes before the content.

use crate::names::{of_service, of_type};
use crate::port::{Node, Server};
use navfuse_core::model::record::Level;
use navfuse_core::model::stream::{Command, StreamError};
use navfuse_core::units::sample::SensorId;
use navfuse_links::Remark;
use std::sync::mpsc::Sender;
use std::task::Waker;

/// Size of the encapsulation before the body of a message.
const ENCAPSULATION: usize = 4;
/// Size of the identity that Cyclone DDS writes before the content: a client, and the number of its request.
const IDENTITY: usize = 16;

/// What a service does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// `std_srvs/srv/Trigger`.
    Trigger(Command),
    /// `std_srvs/srv/SetBool`: a sensor off or on.
    Use(SensorId),
}

/// The services of a link.
pub struct Services {
    all: Vec<(String, Task, Server)>,
    /// Set where the scenario lets the link command the run.
    may: bool,
}

impl Services {
    /// Offers the services of a run with these sensors.
    pub fn offer(node: &Node, sensors: &[String], may: bool) -> Result<Self, StreamError> {
        let mut tasks = vec![
            ("/navfuse/reset".to_owned(), Task::Trigger(Command::Reset)),
            ("/navfuse/checkpoint".to_owned(), Task::Trigger(Command::Checkpoint)),
        ];
        // a name of ROS 2 has letters, digits and underscores
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        for (k, sensor) in sensors.iter().enumerate() {
            let name: String = sensor.chars().map(plain).collect();
            tasks.push((format!("/navfuse/enable_{name}"), Task::Use(SensorId(k))));
        }
        let open = |(name, task): (String, Task)| {
            let kind = match task {
                Task::Trigger(_) => "std_srvs/srv/Trigger",
                Task::Use(_) => "std_srvs/srv/SetBool",
            };
            let topics = of_service(&name);
            let types = ["Request", "Response"].map(|part| of_type(&format!("{kind}_{part}")));
            let server = node.serve([&topics[0], &types[0]], [&topics[1], &types[1]])?;
            Ok((name, task, server))
        };
        Ok(Self { all: tasks.into_iter().map(open).collect::<Result<_, StreamError>>()?, may })
    }

    /// Answers the requests that are there, and passes their commands on.
    pub fn answer(&self, waker: &Waker, to: &Sender<Remark>) {
        for (name, task, server) in &self.all {
            // before the requests, so that none is overlooked
            server.wake(waker);
            while let Some((request, asker)) = server.take() {
                let Some((identity, flag)) = parse(&request) else { continue };
                let (success, message) = match self.may {
                    true => (true, "passed to the run; /diagnostics and its log have the outcome"),
                    false => (false, "commands are refused: set commands = true in the link"),
                };
                server.answer(asker, &response(identity, success, message));
                let remark = match (self.may, *task) {
                    (true, Task::Trigger(command)) => Remark::Command(command),
                    (true, Task::Use(sensor)) => Remark::Command(Command::Use(sensor, flag)),
                    (false, _) => Remark::Report(Level::Warning, format!("{name}: {message}")),
                };
                // the feed that takes it ends with this link
                to.send(remark).ok();
            }
        }
    }
}

/// The identity of a request in little endian, where it has one, and its flag.
fn parse(request: &[u8]) -> Option<(Option<[u8; IDENTITY]>, bool)> {
    let little = *request.get(1)? == 1;
    let body = request.get(ENCAPSULATION..)?;
    let Some((identity, content)) = body.split_first_chunk::<IDENTITY>() else {
        return Some((None, *body.first()? != 0));
    };
    let mut identity = *identity;
    if !little {
        identity.chunks_exact_mut(8).for_each(<[u8]>::reverse);
    }
    Some((Some(identity), *content.first()? != 0))
}

/// An answer in CDR with its encapsulation.
fn response(identity: Option<[u8; IDENTITY]>, success: bool, message: &str) -> Vec<u8> {
    let mut out = vec![0, 1, 0, 0];
    out.extend(identity.iter().flatten());
    // a text begins at a multiple of four with its length, and ends with a zero
    out.extend([u8::from(success), 0, 0, 0]);
    out.extend((message.len() as u32 + 1).to_le_bytes());
    out.extend(message.as_bytes());
    out.push(0);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_of_both_middlewares_are_read_in_both_orders_of_bytes() {
        let identity: [u8; 16] = std::array::from_fn(|k| k as u8);
        // Fast DDS pads to four bytes
        assert_eq!(parse(&[0, 1, 0, 3, 1, 0, 0, 0]), Some((None, true)));
        assert_eq!(parse(&[0, 1, 0, 0, 0]), Some((None, false)));
        let little = [&[0, 1, 0, 0][..], &identity, &[1]].concat();
        assert_eq!(parse(&little), Some((Some(identity), true)));
        let mut swapped = identity;
        swapped.chunks_exact_mut(8).for_each(<[u8]>::reverse);
        let big = [&[0, 0, 0, 0][..], &swapped, &[0]].concat();
        assert_eq!(parse(&big), Some((Some(identity), false)));
        for cut in [&big[..0], &big[..4], &big[..20]] {
            assert_eq!(parse(cut), None, "{cut:?}");
        }
    }

    #[test]
    fn an_answer_is_the_cdr_of_success_and_message() {
        assert_eq!(response(None, true, "ok"), [0, 1, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, b'o', b'k', 0]);
        assert_eq!(
            response(Some([7; 16]), false, "")[4..],
            [&[7; 16][..], &[0, 0, 0, 0, 1, 0, 0, 0, 0]].concat()
        );
    }
}
