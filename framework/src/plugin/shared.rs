//! Values that several runs of a program share.

use std::any::Any;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Values that several runs share, such as the error-free samples of one trajectory. A campaign
/// passes it to the runs of a point with
/// [`Scenario::sharing`](crate::run::scenario::Scenario::sharing), and a source finds it in
/// [`OpenContext::shared`](crate::plugin::OpenContext::shared).
///
/// ```
/// use navfuse_core::plugin::Shared;
/// let shared = Shared::default();
/// let first = shared.find(|text: &String| text == "a", || "a".to_owned());
/// let again = shared.clone().find(|text: &String| text == "a", || "a".to_owned());
/// assert!(std::sync::Arc::ptr_eq(&first, &again));
/// ```
#[derive(Clone, Default)]
pub struct Shared(Arc<Mutex<Vec<Arc<dyn Any + Send + Sync>>>>);

impl Shared {
    /// The value of type `T` that fits, or a new one where none does.
    pub fn find<T: Any + Send + Sync>(
        &self,
        fits: impl Fn(&T) -> bool,
        make: impl FnOnce() -> T,
    ) -> Arc<T> {
        let mut values = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut of_type = values.iter().filter_map(|value| Arc::clone(value).downcast::<T>().ok());
        if let Some(value) = of_type.find(|value| fits(value)) {
            return value;
        }
        let value = Arc::new(make());
        values.push(value.clone());
        value
    }
}

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
}
