//! Connection of input models with the driving sensors that they correct.

use crate::document::{DocumentError, Node, did_you_mean};
use crate::model::process::input::{AnyInput, Correction};
use crate::model::sensor::{Purpose, Sensor};
use crate::run::building::process_place;
use crate::state::Layout;
use crate::state::covariance::Transition;
use std::sync::Arc;

/// An input model and its process.
pub(super) struct InputPart {
    pub(super) owner: String,
    pub(super) sensor: String,
    pub(super) model: Box<dyn AnyInput>,
}

/// Hands each driving sensor its input models, in the order of their tables, and connects their
/// states with the rows of `Phi` that the sensor's processes declare in `places`.
pub(super) fn connect(
    root: &Node<'_>,
    mut parts: Vec<InputPart>,
    places: &[(String, usize)],
    layout: &Layout,
    transition: &mut Transition,
    sensors: &mut [Sensor],
) -> Result<(), DocumentError> {
    for part in &parts {
        check(part, places, sensors)
            .map_err(|text| process_place(root, &part.owner).error(text))?;
    }
    for sensor in sensors {
        let name = &sensor.info.name;
        let own = |part: &mut InputPart| part.sensor == *name;
        let models: Vec<_> = parts.extract_if(.., own).map(|part| part.model).collect();
        if !models.is_empty() {
            let correction = Correction::new(layout, models);
            let own = places.iter().filter(|(sensor, _)| sensor == name);
            let own: Vec<usize> = own.map(|(_, place)| *place).collect();
            let link = transition.link_inputs(&own, &correction.columns(layout));
            sensor.correction = Some(Arc::new(correction.linked(link)));
        }
    }
    Ok(())
}

/// Checks that the sensor of an input model exists, has its channels, and drives a process that
/// carries the effect of its channels.
fn check(
    InputPart { sensor: name, model, .. }: &InputPart,
    places: &[(String, usize)],
    sensors: &[Sensor],
) -> Result<(), String> {
    let driving = sensors.iter().filter(|s| s.info.purpose == Purpose::Input);
    let names: Vec<&str> = driving.clone().map(|s| s.info.name.as_str()).collect();
    let Some(sensor) = driving.into_iter().find(|s| s.info.name == *name) else {
        let hint = did_you_mean(name, names.iter().copied())
            .map_or_else(String::new, |near| format!(" Did you mean {near}?"));
        return Err(format!(
            "there is no driving sensor {name}, whose samples this part corrects (there are: \
             {}).{hint}",
            names.join(", ")
        ));
    };
    let (needed, given) = (model.channels(), sensor.info.channels.len());
    if needed > given {
        return Err(format!(
            "this part corrects {needed} channels, and [sensor.{name}] has {given}; name another \
             driving sensor"
        ));
    }
    if !places.iter().any(|(sensor, _)| sensor == name) {
        return Err(format!(
            "the process that [sensor.{name}] drives does not declare how its channels change the \
             state; it needs Composer::input_place and Transition::set_input"
        ));
    }
    Ok(())
}
