//! The result of a run for Python.

use crate::error::exception;
use crate::recorder::Recorder;
use navfuse_core::session::Finished;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};
use serde_json::json;

/// The result of a run: texts in JSON, and columns of numbers as bytes. The numbers reach numpy as a
/// buffer, so that the package depends on no binary interface of numpy.
pub fn result(py: Python<'_>, mut finished: Finished) -> PyResult<Bound<'_, PyDict>> {
    let recorder = finished.take_sink::<Recorder>().unwrap_or_default();
    let (estimate, innovations) = (recorder.describe(), recorder.innovations);
    let summary = navfuse::summary(&finished).map_err(exception)?;
    let result = PyDict::new(py);
    let text = json!({ "summary": summary, "estimate": estimate });
    result.set_item("text", text.to_string())?;
    result.set_item("columns", bytes(py, recorder.columns)?)?;
    let tables = PyList::empty(py);
    for sensor in innovations.into_iter().filter(|s| !s.is_empty()) {
        let text = sensor.describe().to_string();
        tables.append((text, bytes(py, sensor.columns)?))?;
    }
    result.set_item("innovations", tables)?;
    result.set_item("error", finished.error.map(exception))?;
    Ok(result)
}

/// Columns one after the other, as the bytes of their numbers.
pub fn bytes(py: Python<'_>, columns: Vec<Vec<f64>>) -> PyResult<Bound<'_, PyBytes>> {
    let length = columns.iter().map(Vec::len).sum::<usize>() * size_of::<f64>();
    PyBytes::new_with(py, length, |bytes| {
        let places = bytes.chunks_exact_mut(size_of::<f64>());
        let numbers = columns.into_iter().flatten();
        places
            .zip(numbers)
            .for_each(|(place, number)| place.copy_from_slice(&number.to_ne_bytes()));
        Ok(())
    })
}
