//! Live runs from end to end: the command on samples that arrive over its links.

mod commands;
mod container;
mod desk;
mod embedded;
mod faults;
mod mavlink;
mod outages;
mod restart;
mod screen;
mod sockets;
