//! The update rules of a scenario, by name.

use crate::document::{DocumentError, Node, unknown};
use crate::filter::{Iterated, Unscented};
use crate::model::sensor::rule::{Linear, UpdateRule};
use crate::plugin::Registry;
use crate::run::parts::Part;

/// All update rules, and the rule of the sensors that state none.
pub(crate) struct Rules {
    all: Vec<UpdateRule>,
    pub(crate) default: UpdateRule,
}

impl Rules {
    /// Rules of the framework and of plugins. The first one is the default.
    pub(crate) fn of(registry: &Registry) -> Self {
        let default = UpdateRule::of::<Linear>();
        let own = [default, UpdateRule::of::<Iterated>(), UpdateRule::of::<Unscented>()];
        Self { all: own.into_iter().chain(registry.rules()).collect(), default }
    }

    /// Names of the rules.
    pub(crate) fn names(&self) -> Vec<&'static str> {
        self.all.iter().map(|rule| rule.name).collect()
    }

    /// The same rules with the default of a scenario.
    pub(crate) fn with_default(self, root: &Node<'_>, name: &str) -> Result<Self, DocumentError> {
        let table = root.get("estimator").unwrap_or_else(|| root.clone());
        Ok(Self { default: self.find(&table, name)?, ..self })
    }

    /// Update rule of a sensor: its own, or the default.
    pub(crate) fn of_sensor(
        &self,
        part: &Part<'_>,
        name: Option<&str>,
        offset: bool,
    ) -> Result<UpdateRule, DocumentError> {
        let rule = name.map_or(Ok(self.default), |name| self.find(&part.node, name))?;
        if !rule.evaluates || !offset {
            return Ok(rule);
        }
        let place = part.node.get("update").or_else(|| part.node.get("time_offset"));
        Err(place.unwrap_or_else(|| part.node.clone()).error(format!(
            "a sensor with a time offset measures a past state, which \"{}\" does not support; \
             give [sensor.{}] update = \"ekf\", or remove its time_offset",
            rule.name, part.name
        )))
    }

    /// The rule of that name, which a table states.
    fn find(&self, table: &Node<'_>, name: &str) -> Result<UpdateRule, DocumentError> {
        self.all.iter().find(|rule| rule.name == name).copied().ok_or_else(|| {
            let place = table.get("update").unwrap_or_else(|| table.clone());
            place.error(unknown("update rule", name, &self.names()))
        })
    }
}
