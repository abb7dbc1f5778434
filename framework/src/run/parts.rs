//! The tables of a scenario that name a registered type: processes, sensors, sources and sinks.

use crate::compose::keys::{
    ENABLED, PROCESS_KEYS, SIMULATION, SensorKeys, TABLE_KEYS, TYPE, WANDER,
};
use crate::document::{DocumentError, Inside, Node, did_you_mean};
use crate::plugin::{Entry, Kind, Registry};

/// The keys that the framework takes from every table of a kind, beside the keys of its type.
pub fn common_keys(kind: Kind) -> &'static [&'static str] {
    match kind {
        Kind::Sensor => SensorKeys::TABLE_KEYS,
        Kind::Process => &PROCESS_KEYS,
        _ => &TABLE_KEYS,
    }
}

/// One enabled table of a kind: name, type and place.
pub(crate) struct Part<'a> {
    pub name: &'a str,
    pub entry: &'a Entry,
    pub node: Node<'a>,
}

impl Part<'_> {
    /// The table without the keys of the framework.
    pub fn own_keys(&self) -> Node<'_> {
        let node = self.node.without(common_keys(self.entry.kind));
        match &self.entry.simulation_keys[..] {
            [] => node,
            keys => node.inside(Inside { key: SIMULATION, keys, others: false }),
        }
    }

    /// Returns `true` if the truth of a process moves by its own equations.
    pub fn wanders(&self) -> Result<bool, DocumentError> {
        self.node.get(WANDER).map_or(Ok(false), |wander| wander.parse())
    }

    /// The keys of the framework in the table of a sensor.
    pub fn sensor_keys(&self) -> Node<'_> {
        let keys = &self.entry.simulation_keys[..];
        let node = self.node.only(SensorKeys::KEYS);
        node.inside(Inside { key: SIMULATION, keys, others: true })
    }
}

/// The enabled tables of a kind, in the order of the file.
pub(crate) fn parts<'a>(
    root: &Node<'a>,
    registry: &'a Registry,
    kind: Kind,
) -> Result<Vec<Part<'a>>, DocumentError> {
    let mut parts = Vec::new();
    for (name, node) in tables(root, kind)? {
        if enabled(&node)? {
            let entry = entry(registry, kind, name, &node)?;
            parts.push(Part { name, entry, node });
        }
    }
    Ok(parts)
}

/// The names of the tables of a kind that the scenario disables.
pub(crate) fn disabled(root: &Node<'_>, kind: Kind) -> Result<Vec<String>, DocumentError> {
    let mut names = Vec::new();
    for (name, node) in tables(root, kind)? {
        if !enabled(&node)? {
            names.push(name.to_owned());
        }
    }
    Ok(names)
}

/// All tables of a kind, in the order of the file.
fn tables<'a>(root: &Node<'a>, kind: Kind) -> Result<Vec<(&'a str, Node<'a>)>, DocumentError> {
    let Some(table) = root.get(kind.table()) else { return Ok(Vec::new()) };
    let tables = table.entries()?;
    match tables.iter().find(|(_, node)| !node.value().is_table()) {
        Some((name, node)) => {
            Err(node.error(format!("a table is needed: [{}.{name}]", kind.table())))
        }
        None => Ok(tables),
    }
}

fn enabled(node: &Node<'_>) -> Result<bool, DocumentError> {
    node.get(ENABLED).map_or(Ok(true), |enabled| enabled.parse())
}

/// The registered type of a table: the one that its key `type` names, or else the one of its name.
fn entry<'a>(
    registry: &'a Registry,
    kind: Kind,
    name: &str,
    node: &Node<'_>,
) -> Result<&'a Entry, DocumentError> {
    let (place, wanted) = match node.get(TYPE) {
        Some(given) => (given.clone(), given.parse::<String>()?),
        None => (node.clone(), name.to_owned()),
    };
    registry.get(kind, &wanted).ok_or_else(|| {
        let names: Vec<&str> =
            registry.entries().filter(|e| e.kind == kind).map(|e| &*e.name).collect();
        let meant = did_you_mean(&wanted, names.iter().copied());
        let hint = meant.map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
        let (table, names) = (kind.table(), names.join(", "));
        let message =
            format!("unknown {table} type {wanted:?}{hint} (registered: {names}; or set `type`)");
        place.unknown_name(message, meant)
    })
}
