//! The state: blocks on manifolds, their layout in one flat vector, the error state and its
//! covariance.

mod back;
pub mod block;
pub mod block_set;
pub(crate) mod carried;
pub mod covariance;
pub mod display;
pub(crate) mod dynamics;
pub mod error;
pub mod geodesy;
pub mod layout;
pub mod manifold;
pub mod transient;
mod vectorised;
pub mod view;

pub use block::{Block, BlockSpec, Display, Dynamics, Mode};
pub use block_set::BlockSet;
pub use layout::{AnyHandle, BodyInfo, Handle, Layout, Past, Signal, State, Vehicle};
pub use transient::Transients;
pub(crate) use vectorised::{magnitude, select, vectorised};
pub use view::View;
