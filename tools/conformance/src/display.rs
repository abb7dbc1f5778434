//! Presentation of the states: a scale that does not belong to its unit shows a wrong sigma, and no
//! other check reads it.

use crate::lab::Lab;
use crate::{Failure, Report};
use navfuse_core::state::Block;
use navfuse_core::units::parse_unit;

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    let composition = &lab.composition;
    let sensors = lab.sensors().into_iter();
    let named = sensors.map(|p| (composition.sensors[p.index].info.name.as_str(), p.about));
    let processes = lab.processes().into_iter();
    let processes = processes.map(|p| (composition.processes[p.index].name.as_str(), p.about));
    for (name, about) in named.chain(processes) {
        let own = |b: &&Block| b.name.split('.').next() == Some(name);
        let own: Vec<&Block> = composition.layout.blocks.iter().filter(own).collect();
        if !own.is_empty() {
            let shown = own.iter().try_for_each(|block| of_block(block));
            let count = own.len();
            report.add(
                "display",
                about,
                shown.map(|()| format!("unit and scale of {count} states")),
            );
        }
    }
}

/// The scale of a block is its unit in SI, and each axis has a name, or none has.
fn of_block(block: &Block) -> Result<(), Failure> {
    let (name, shown) = (&block.name, &block.spec.display);
    let unit = match shown.unit {
        "" => 1.0,
        unit => parse_unit(unit)
            .map_err(|e| Failure::during(format!("the unit of {name}"), e))?
            .to_si(1.0),
    };
    let off = (shown.scale / unit - 1.0).abs();
    // an author types a few digits
    if off.is_nan() || off > 1e-4 {
        return Err(Failure::new(format!(
            "the state {name} is shown in {} with the scale {}, and one such unit is {unit} in SI; set \
             `scale` of its Display to that",
            shown.unit, shown.scale
        )));
    }
    let axes = block.operations.tangent;
    if !shown.components.is_empty() && shown.components.len() != axes {
        return Err(Failure::new(format!(
            "the state {name} has {axes} axes, and its Display names {}: {:?}",
            shown.components.len(),
            shown.components
        )));
    }
    Ok(())
}
