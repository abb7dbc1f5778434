//! Tables of which a sensor needs several: a file for each channel, and gravity beside accelerations without it.

use crate::found::Found;
use crate::recording::{BEGINNING, Reader, Recording, TABLE};
use crate::table::{self, BY_CONTENT};
use navfuse_core::document::quoted;
use navfuse_core::model::stream::StreamError;
use std::path::{Path, PathBuf};

/// Least number of files with one value in each row that are read beside each other.
const LEAST: usize = 3;

/// A file that is given, and set where a folder has it and nobody named it.
pub type Given = (PathBuf, bool);

/// The sensors of tables whose columns stand beside each other, by their headings alone.
fn sensors(files: &[PathBuf]) -> Result<Vec<Found>, StreamError> {
    let [first, others @ ..] = files else { return Ok(Vec::new()) };
    let most = usize::try_from(TABLE).unwrap_or(usize::MAX / 2);
    let text =
        navfuse_csv::beginning_of_files(files, most).map_err(|e| StreamError::open(first, e))?;
    let mut found = table::recognise(&text, "").unwrap_or_default();
    found.retain(|found| !found.questions.iter().any(|text| text.contains(BY_CONTENT)));
    let list: Vec<String> = others.iter().map(|file| quoted(&file.display().to_string())).collect();
    let key = format!("beside = [{}]", list.join(", "));
    for found in &mut found {
        found.source.push(key.clone());
        found.apart.iter_mut().for_each(|apart| apart.source.push(key.clone()));
    }
    Ok(found)
}

/// Tests whether the columns of a sensor are in a file, by the name that the headings have from it.
fn uses(found: &[Found], file: &Path) -> bool {
    let stem = file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let keys = found.iter().flat_map(|f| &f.source).filter(|key| key.starts_with("columns."));
    let name = format!("\"{stem}.");
    keys.into_iter().any(|key| key.contains(&name))
}

impl Recording {
    /// Takes files with one value in each row, most of which are no sensor alone, beside each other; returns the others.
    ///
    /// # Errors
    /// When a file cannot be read, or has a sensor that another one has.
    pub fn take_channels(&mut self, given: Vec<Given>) -> Result<Vec<Given>, StreamError> {
        let one = |(file, _): &Given| {
            let bytes = (!file.is_dir()).then(|| navfuse_csv::beginning(file, BEGINNING).ok());
            let text = bytes.flatten().map(|bytes| navfuse_csv::text(&bytes).into_owned());
            text.filter(|text| navfuse_csv::has_one_value(text))
        };
        let texts: Vec<Option<String>> = given.iter().map(one).collect();
        let stem = |file: &Path| file.file_stem().map(|s| s.to_string_lossy().into_owned());
        let alone = given.iter().zip(&texts).filter(|((file, _), text)| {
            let known = |text: &String| table::recognise(text, &stem(file).unwrap_or_default());
            text.as_ref().is_some_and(|text| known(text).is_err())
        });
        if alone.count() < LEAST {
            return Ok(given);
        }
        let (own, others): (Vec<_>, Vec<_>) =
            given.into_iter().zip(texts).partition(|(_, text)| text.is_some());
        let [own, mut others] = [own, others]
            .map(|list| list.into_iter().map(|(file, _)| file).collect::<Vec<Given>>());
        let files = absolute(own.iter().map(|(file, _)| file))?;
        let found = sensors(&files)?;
        if found.is_empty() {
            others.extend(own);
            return Ok(others);
        }
        self.take_beside(found, &files)?;
        Ok(others)
    }

    /// Takes tables that were refused each by itself for an inertial unit, or its accelerometers, beside each other, and
    /// leaves the others.
    ///
    /// # Errors
    /// When a file cannot be read, or has a sensor that another one has.
    pub fn take_refused(
        &mut self,
        refused: &mut Vec<(Given, StreamError)>,
    ) -> Result<(), StreamError> {
        let files = absolute(refused.iter().map(|((file, _), _)| file).filter(|f| !f.is_dir()))?;
        let inertial = |files: &[PathBuf]| -> Result<Vec<Found>, StreamError> {
            let mut found = if files.len() > 1 { sensors(files)? } else { Vec::new() };
            found.retain(|found| ["imu", "accels"].contains(&found.kind));
            Ok(found)
        };
        let first = inertial(&files)?;
        let files: Vec<PathBuf> = files.into_iter().filter(|file| uses(&first, file)).collect();
        let found = inertial(&files)?;
        if !found.is_empty() {
            self.take_beside(found, &files)?;
            let used = |file: &Path| std::fs::canonicalize(file).is_ok_and(|f| files.contains(&f));
            refused.retain(|((file, _), _)| !used(file));
        }
        Ok(())
    }

    fn take_beside(&mut self, found: Vec<Found>, files: &[PathBuf]) -> Result<(), StreamError> {
        let Some(first) = files.first() else { return Ok(()) };
        let kinds: Vec<&str> = found.iter().map(|found| found.kind).collect();
        let names = files.iter().filter_map(|file| Some(file.file_name()?.to_string_lossy()));
        self.notes.push(format!(
            "{}: the columns of {} stand beside each other",
            kinds.join(", "),
            names.collect::<Vec<_>>().join(", ")
        ));
        self.contents.push((first.clone(), kinds.join(", ")));
        for found in found {
            self.add_part(found, Reader::Csv, first, first, None)?;
        }
        Ok(())
    }
}

fn absolute<'a>(files: impl Iterator<Item = &'a PathBuf>) -> Result<Vec<PathBuf>, StreamError> {
    let one = |file: &PathBuf| std::fs::canonicalize(file).map_err(|e| StreamError::open(file, e));
    files.map(one).collect()
}
