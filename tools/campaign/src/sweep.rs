//! Table of a grid's results, one row per point.

use crate::CampaignError;
use crate::report::{CampaignReport, PointReport};
use crate::tables::{Names, TableWriter};
use navfuse_core::files::write_whole;
use std::path::{Path, PathBuf};

pub const CSV: &str = "sweep.csv";
pub const PARQUET: &str = "sweep.parquet";

/// Names and values of the real-valued columns of a point.
fn numbers(point: &PointReport) -> Vec<(String, f64)> {
    let mut row = Vec::new();
    let mut add = |name: String, value: Option<f64>| row.push((name, value.unwrap_or(f64::NAN)));
    add("runs".into(), Some(point.runs as f64));
    for s in &point.states {
        let name = s.component.name();
        add(format!("{name}.bound"), s.bound);
        add(format!("{name}.smoothed"), s.smoothed);
        if point.verdict.is_some() {
            add(format!("{name}.rmse"), s.rmse);
            add(format!("{name}.sigma"), s.sigma);
        }
    }
    if point.verdict.is_some() {
        point.anees.iter().for_each(|a| add(format!("{}.anees", a.of.replace(' ', "_")), a.value));
        point.nis.iter().for_each(|n| add(format!("{}.mean_nis", n.sensor), n.mean));
    }
    row
}

/// Writes the table as CSV and as Parquet and returns both paths.
pub fn write(folder: &Path, report: &CampaignReport) -> Result<[PathBuf; 2], CampaignError> {
    let paths = [folder.join(CSV), folder.join(PARQUET)];
    let rows: Vec<Vec<(String, f64)>> = report.points.iter().map(numbers).collect();
    // a point that failed before its first run has fewer columns
    let widest = rows.iter().max_by_key(|r| r.len()).cloned().unwrap_or_default();
    let real: Vec<String> = widest.into_iter().map(|(name, _)| name).collect();
    let mut text = report.keys.clone();
    text.push("verdict".into());
    let fail = |e: csv::Error| CampaignError::file(&paths[0], e);
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(text.iter().chain(&real)).map_err(fail)?;
    let mut parquet =
        TableWriter::create(&paths[1], &Names { text, whole: Vec::new(), real: real.clone() })?;
    for (point, row) in report.points.iter().zip(&rows) {
        let verdict = point.verdict.as_ref().map_or("", |v| v.text.as_str());
        let words: Vec<&str> = point.values.iter().map(String::as_str).chain([verdict]).collect();
        let find = |name: &String| {
            row.iter().find(|(n, _)| n == name).map_or(f64::NAN, |(_, value)| *value)
        };
        let values: Vec<f64> = real.iter().map(find).collect();
        parquet.push(&words, &[], &values)?;
        let cells = values.iter().map(|v| if v.is_nan() { String::new() } else { v.to_string() });
        csv.write_record(words.iter().map(|w| (*w).to_owned()).chain(cells)).map_err(fail)?;
    }
    let table = csv.into_inner().map_err(|e| CampaignError::file(&paths[0], e.into_error()))?;
    write_whole(&paths[0], &table).map_err(|e| CampaignError::file(&paths[0], e))?;
    parquet.finish()?;
    Ok(paths)
}
