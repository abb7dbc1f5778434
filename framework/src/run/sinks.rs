//! Opening the sinks of a scenario, once none of their files collides with another.

use crate::document::{Document, DocumentError, Node};
use crate::files::{FolderError, keep_earlier};
use crate::model::stream::NamedSink;
use crate::plugin::{BuildError, Entry, Make, OpenContext, PreparedSink};
use crate::run::parts::Part;
use std::path::{Path, PathBuf};

/// A sink that is configured but not open.
pub(crate) struct Prepared<'a> {
    name: &'a str,
    node: Node<'a>,
    sink: PreparedSink,
}

/// Configures the sinks of the tables, and those that are on by default with the keys of `empty`.
pub(crate) fn prepare<'a>(
    parts: &[Part<'a>],
    default: &[&'a Entry],
    empty: &'a Document,
) -> Result<Vec<Prepared<'a>>, BuildError> {
    let mut prepared = Vec::new();
    for part in parts {
        if let Make::Sink { prepare, .. } = &part.entry.make {
            let sink = prepare(&part.own_keys())?;
            prepared.push(Prepared { name: part.name, node: part.node.clone(), sink });
        }
    }
    for entry in default {
        if let Make::Sink { prepare, .. } = &entry.make {
            let node = empty.root();
            let sink = prepare(&node)?;
            prepared.push(Prepared { name: &entry.name, node, sink });
        }
    }
    Ok(prepared)
}

/// Rejects two sinks that write the same file, before either of them opens it.
pub(crate) fn check_files(
    sinks: &[Prepared<'_>],
    context: &OpenContext<'_>,
) -> Result<(), DocumentError> {
    let mut claimed: Vec<(PathBuf, &str)> = Vec::new();
    for Prepared { name, node, sink } in sinks {
        for file in &sink.files {
            let path = context.output.join(file);
            let place = resolved(&path);
            if let Some((_, other)) = claimed.iter().find(|(claimed, _)| *claimed == place) {
                return Err(node.error(format!(
                    "[sink.{other}] and [sink.{name}] both write {}; give one of them another \
                     `path`, or disable it with enabled = false",
                    path.display()
                )));
            }
            claimed.push((place, name));
        }
    }
    Ok(())
}

/// The path without links and `..` in its folder, so that two spellings of a file are equal.
fn resolved(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let folder = absolute.parent().and_then(|folder| folder.canonicalize().ok());
    match folder.zip(absolute.file_name()) {
        Some((folder, name)) => folder.join(name),
        None => absolute,
    }
}

/// Opens the sinks, each with its name. Files of an earlier run are kept beside.
pub(crate) fn open(
    sinks: Vec<Prepared<'_>>,
    context: &OpenContext<'_>,
) -> Result<Vec<NamedSink>, BuildError> {
    let files = sinks.iter().flat_map(|s| &s.sink.files);
    keep_earlier(&context.output, files)
        .map_err(|source| FolderError::Keep { path: context.output.clone(), source })?;
    let mut open = Vec::new();
    for Prepared { name, node, sink } in sinks {
        let sink = (sink.open)(context).map_err(|e| e.at(&node))?;
        open.push((name.to_owned(), sink));
    }
    Ok(open)
}
