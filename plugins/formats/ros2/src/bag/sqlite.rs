//! Bags in SQLite: the tables `topics` and `messages`, read without the SQLite library, which is a
//! large program in C and refuses a file that is cut off. A bag needs two tables of it.

use super::faults::Faults;
use super::pages::Pages;
use super::table::{Row, Table};
use super::topics::{Found, Place, Topic, Topics};
use navfuse_core::input::Input;
use std::collections::BTreeMap;
use std::io::Result;

/// First bytes of the file.
pub const MAGIC: &[u8; 16] = b"SQLite format 3\0";
/// Largest number of topics.
const MOST_TOPICS: usize = 4096;

/// A table of the database: the page of its root and its columns.
struct Description {
    root: u32,
    columns: Vec<String>,
}

impl Description {
    fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c == name)
    }
}

/// The columns of `messages`.
#[derive(Clone, Copy)]
struct Columns {
    topic: usize,
    time: usize,
    data: usize,
}

/// A bag in SQLite.
pub struct Sqlite {
    pages: Pages,
    base: u64,
    messages: Table,
    columns: Columns,
    topics: BTreeMap<i64, usize>,
    row: Row,
}

/// The columns of a table by the statement that created it.
fn columns(statement: &str) -> Vec<String> {
    let inner = statement.split_once('(').map_or("", |(_, rest)| rest);
    let inner = inner.rsplit_once(')').map_or(inner, |(inner, _)| inner);
    let name = |part: &str| {
        let word = part.split_whitespace().next().unwrap_or_default();
        word.trim_matches(['"', '`', '[', ']']).to_lowercase()
    };
    inner.split(',').map(name).collect()
}

impl Sqlite {
    /// Opens a database at an offset of its bag; an error has the reason why it is no bag.
    pub fn open(
        file: Input,
        base: u64,
        topics: &mut Topics,
        faults: &mut Faults,
    ) -> Result<std::result::Result<Self, String>> {
        let Some(mut pages) = Pages::new(file)? else {
            return Ok(Err("it is a database of SQLite whose header is damaged".to_owned()));
        };
        let mut tables = BTreeMap::new();
        let (mut schema, mut row) = (Table::new(1), Row::default());
        while schema.next(&mut pages, base, &mut row, faults)? {
            if !schema.complete(&mut pages, &mut row, faults)? || tables.len() >= MOST_TOPICS {
                continue;
            }
            let root = row.integer(3).and_then(|root| u32::try_from(root).ok());
            if let (Some("table"), Some(name), Some(root), Some(statement)) =
                (row.text(0).as_deref(), row.text(1), root, row.text(4))
            {
                tables.insert(name, Description { root, columns: columns(&statement) });
            }
        }
        let found = tables.get("messages").and_then(|t| {
            let (topic, time) = (t.column("topic_id")?, t.column("timestamp")?);
            Some((t.root, Columns { topic, time, data: t.column("data")? }))
        });
        let (Some((root, columns)), Some(described)) = (found, tables.get("topics")) else {
            let names: Vec<&str> = tables.keys().map(String::as_str).take(8).collect();
            let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            return Ok(Err(format!(
                "it is a database of SQLite without the tables topics and messages of a bag; its tables: {names}"
            )));
        };
        let mut definitions = BTreeMap::new();
        if let Some(t) = tables.get("message_definitions")
            && let (Some(kind), Some(form), Some(text)) = (
                t.column("topic_type"),
                t.column("encoding"),
                t.column("encoded_message_definition"),
            )
        {
            let mut table = Table::new(t.root);
            while table.next(&mut pages, base, &mut row, faults)? {
                if table.complete(&mut pages, &mut row, faults)?
                    && row.text(form).as_deref() == Some("ros2msg")
                    && definitions.len() < MOST_TOPICS
                    && let (Some(kind), Some(text)) = (row.text(kind), row.text(text))
                {
                    definitions.insert(kind, text);
                }
            }
        }
        let mut by_number = BTreeMap::new();
        if let (Some(name), Some(kind)) = (described.column("name"), described.column("type")) {
            let form = described.column("serialization_format");
            let mut table = Table::new(described.root);
            while table.next(&mut pages, base, &mut row, faults)? {
                if !table.complete(&mut pages, &mut row, faults)? {
                    continue;
                }
                let (Some(name), Some(kind)) = (row.text(name), row.text(kind)) else { continue };
                let encoding = form.and_then(|form| row.text(form)).unwrap_or_default();
                let definition = definitions.get(&kind).cloned();
                if let Some(topic) = topics.add(Topic { name, kind, encoding, definition }) {
                    by_number.insert(row.number, topic);
                }
            }
        }
        let messages = Table::new(root);
        Ok(Ok(Self { pages, base, messages, columns, topics: by_number, row }))
    }

    /// Finds the next message of a wanted topic; `None` at the end.
    pub fn advance(
        &mut self,
        wanted: impl Fn(usize) -> bool,
        faults: &mut Faults,
    ) -> Result<Option<Found>> {
        let Columns { topic, time, data } = self.columns;
        while self.messages.next(&mut self.pages, self.base, &mut self.row, faults)? {
            let offset = self.row.offset;
            let (Some(topic), Some(received)) = (self.row.integer(topic), self.row.integer(time))
            else {
                faults.records.add(offset);
                continue;
            };
            let Some(topic) = self.topics.get(&topic).copied() else {
                faults.strangers.add(offset);
                continue;
            };
            if wanted(topic) && !self.messages.complete(&mut self.pages, &mut self.row, faults)? {
                continue;
            }
            return Ok(Some(Found { topic, received, offset, place: Place::Row(data) }));
        }
        Ok(None)
    }

    /// The bytes of a message that [`Self::advance`] found.
    pub fn data(&self, column: usize) -> &[u8] {
        self.row.bytes(column).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_columns_of_a_table_are_those_of_its_statement() {
        let statement = "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,\n \
                         \"timestamp\" INTEGER NOT NULL, data BLOB NOT NULL)";
        assert_eq!(columns(statement), ["id", "topic_id", "timestamp", "data"]);
    }
}
