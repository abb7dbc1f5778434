//! The network in a program that was built without it.

use navfuse_core::model::stream::StreamError;
use std::net::IpAddr;
use std::task::Waker;

/// A participant, of which there is none.
pub enum Node {}
/// A topic that is read, of which there is none.
pub enum Subscription {}
/// A topic that is written, of which there is none.
pub enum Publication {}
/// A service, of which there is none.
pub enum Server {}
/// A request, of which there is none.
pub enum Asker {}

impl Node {
    pub fn join(_: u16, _: &[IpAddr]) -> Result<Self, StreamError> {
        Err(StreamError::scenario("this program was built without ROS 2")
            .with_remedy("build it with `cargo build --release --features ros2`"))
    }

    pub fn written(&self) -> Vec<(String, String)> {
        match *self {}
    }

    pub fn subscribe(&self, _: &str, _: &str) -> Result<Subscription, StreamError> {
        match *self {}
    }

    pub fn serve(&self, _: [&str; 2], _: [&str; 2]) -> Result<Server, StreamError> {
        match *self {}
    }

    pub fn publish(&self, _: &str, _: &str) -> Result<Publication, StreamError> {
        match *self {}
    }
}

impl Subscription {
    pub fn wake(&self, _: &Waker) {
        match *self {}
    }

    pub fn take(&self) -> Option<Vec<u8>> {
        match *self {}
    }
}

impl Publication {
    pub fn send(&self, _: &[u8]) {
        match *self {}
    }

    pub fn refused(&self) -> Option<String> {
        match *self {}
    }
}

impl Server {
    pub fn wake(&self, _: &Waker) {
        match *self {}
    }

    pub fn take(&self) -> Option<(Vec<u8>, Asker)> {
        match *self {}
    }

    pub fn answer(&self, _: Asker, _: &[u8]) {
        match *self {}
    }
}
