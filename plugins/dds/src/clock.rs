//! Simulated time: the topic `/clock` of a simulator, or of `ros2 bag play --clock`.

use crate::names::{of_topic, of_type};
use crate::port::{Node, Subscription};
use navfuse_core::model::stream::StreamError;
use std::task::Waker;

/// The topic, and the type of its messages.
pub const TOPIC: &str = "/clock";
const TYPE: &str = "rosgraph_msgs/msg/Clock";
/// Nanoseconds of a second.
const SECOND: i64 = 1_000_000_000;
/// Step back after which the time begins anew, ns: a bag that is played in a loop, or a simulator that is
/// reset. Messages in another order go back by less.
const STEP: i64 = SECOND;

/// The clock of a simulation.
pub struct SimulatedTime {
    messages: Subscription,
    now: Option<i64>,
}

impl SimulatedTime {
    /// Subscribes to the clock.
    pub fn subscribe(node: &Node) -> Result<Self, StreamError> {
        Ok(Self { messages: node.subscribe(&of_topic(TOPIC), &of_type(TYPE))?, now: None })
    }

    /// The time, in nanoseconds since 1970; `None` before the first message.
    pub fn now(&self) -> Option<i64> {
        self.now
    }

    /// Takes all messages that are there; `true` if the time began anew.
    pub fn advance(&mut self, waker: &Waker) -> bool {
        // before the messages, so that none is overlooked
        self.messages.wake(waker);
        let mut anew = false;
        while let Some(message) = self.messages.take() {
            let Some(time) = parse(&message) else { continue };
            anew |= self.now.is_some_and(|now| time < now.saturating_sub(STEP));
            self.now = Some(time);
        }
        anew
    }
}

/// The time in a message, in nanoseconds since 1970.
fn parse(message: &[u8]) -> Option<i64> {
    let little = *message.get(1)? == 1;
    let number = |at: usize| {
        let bytes = *message.get(at..)?.first_chunk::<4>()?;
        Some(if little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    };
    let (seconds, nanos) = (number(4)?.cast_signed(), number(8)?);
    Some(i64::from(seconds) * SECOND + i64::from(nanos))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_message_is_read_in_both_orders_of_bytes() {
        let little = [&[0, 1, 0, 0][..], &7_i32.to_le_bytes(), &5_u32.to_le_bytes()].concat();
        let big = [&[0, 0, 0, 0][..], &7_i32.to_be_bytes(), &5_u32.to_be_bytes()].concat();
        assert_eq!([parse(&little), parse(&big)], [Some(7_000_000_005); 2]);
        assert_eq!(parse(&little[..11]), None);
    }
}
