//! Results on disk: files that appear once they are whole, and folders that keep earlier results.

mod earlier;
mod lock;
mod numbered;
mod own;
mod whole;

pub use earlier::{EARLIER, keep_earlier};
pub use lock::{FolderError, FolderLock};
pub use numbered::numbered;
pub use own::{LIST, check_output, create_growing, has_to_stay};
pub use whole::{WholeFile, part_of, write_whole};
