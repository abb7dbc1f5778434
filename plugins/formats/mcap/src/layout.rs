//! The layout of Foxglove for a log: its panels show the blocks, sensors and frames that the run has.

use crate::frames::{MAP_FRAME, ROS_BODY_FRAME};
use crate::lanes;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::RunInfo;
use navfuse_core::state::Block;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Colours of lines: three axes, then more.
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"];
/// Greatest number of plots of calibration states, and of innovations.
const CALIBRATIONS: usize = 4;
const INNOVATIONS: usize = 5;

/// The file of the layout beside a log: `run.foxglove.json` of `run.mcap`.
pub fn beside(log: &Path) -> PathBuf {
    log.with_extension("foxglove.json")
}

/// The layout in JSON.
pub fn layout(run: &RunInfo) -> Value {
    let mut panels = Map::new();
    let mut place = |id: String, config: Value| -> Value {
        panels.insert(id.clone(), config);
        Value::String(id)
    };
    let vehicle = run.layout.vehicle();
    let mut first = Vec::new();
    if vehicle.position.is_some() && vehicle.attitude.is_some() {
        first.push(place("3D!track".into(), scene(run)));
        first.push(place("map!track".into(), map()));
    }
    let known = run.sensors.iter().filter(|s| s.purpose != Purpose::Reference);
    first.push(place("StateTransitions!health".into(), transitions(known)));
    first.push(place("RosOut!log".into(), events()));
    let compared = is_compared(run);
    let moves = [
        vehicle.attitude.map(|handle| handle.slot()),
        vehicle.velocity.map(|handle| handle.slot()),
        vehicle.position.map(|handle| handle.slot()),
    ];
    let moves: Vec<usize> = moves.into_iter().flatten().collect();
    let mut second = Vec::new();
    for slot in &moves {
        let block = &run.layout.blocks[*slot];
        second.push(place(format!("Plot!{}", block.name), state(block, compared)));
    }
    let mut third = Vec::new();
    let others = run.layout.blocks.iter().enumerate();
    let others = others.filter(|(slot, b)| b.tangent.is_some() && !moves.contains(slot));
    let owner = |block: &Block| block.name.split('.').next().map(str::to_owned);
    let of_sensor = |(_, block): &(usize, &Block)| {
        run.sensors.iter().any(|s| owner(block).as_ref() == Some(&s.name))
    };
    for (_, block) in others.filter(of_sensor).take(CALIBRATIONS) {
        third.push(place(format!("Plot!{}", block.name), state(block, false)));
    }
    let mut fourth = Vec::new();
    let measuring = run.sensors.iter().filter(|s| s.purpose == Purpose::Measurement);
    for sensor in measuring.take(INNOVATIONS) {
        fourth.push(place(format!("Plot!innovation-{}", sensor.name), innovation(sensor)));
    }
    let columns = [first, second, third, fourth].into_iter().filter_map(|c| split("column", c));
    let root = split("row", columns.collect()).unwrap_or(Value::Null);
    json!({
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": { "speed": 1 },
        "layout": root,
    })
}

/// Set where the log has the truth, or a reference.
fn is_compared(run: &RunInfo) -> bool {
    run.simulated || run.sensors.iter().any(|s| s.purpose == Purpose::Reference)
}

/// Panels of equal size beside or above each other; `None` without any.
fn split(direction: &str, mut panels: Vec<Value>) -> Option<Value> {
    let mut all = panels.pop()?;
    let mut count = 1.0;
    while let Some(panel) = panels.pop() {
        count += 1.0;
        all = json!({
            "direction": direction,
            "first": panel,
            "second": all,
            "splitPercentage": 100.0 / count,
        });
    }
    Some(all)
}

fn scene(run: &RunInfo) -> Value {
    let arrow = |scale: f64, colour: &str| json!({ "visible": true, "type": "arrow", "color": colour, "arrowScale": [4.0, scale, scale] });
    let path = |colour: &str| json!({ "visible": true, "gradient": [colour, colour] });
    let mut topics = Map::new();
    topics.insert("/estimate/odometry".into(), arrow(0.6, COLOURS[0]));
    topics.insert("/estimate/path".into(), path(COLOURS[0]));
    topics.insert("/estimate/markers".into(), json!({ "visible": true }));
    if is_compared(run) {
        topics.insert("/reference/odometry".into(), arrow(0.4, COLOURS[5]));
        topics.insert("/reference/path".into(), path(COLOURS[5]));
    }
    let grid = json!({
        "layerId": "foxglove.Grid",
        "instanceId": "grid",
        "visible": true,
        "frameId": MAP_FRAME,
        "size": 2000,
        "divisions": 40,
        "lineWidth": 1,
        "color": "#248eff60",
        "position": [0, 0, 0],
        "rotation": [0, 0, 0],
    });
    json!({
        "foxglovePanelTitle": "Vehicle and sensors",
        "cameraState": {
            "perspective": true,
            "distance": 60,
            "phi": 55,
            "thetaOffset": 45,
            "targetOffset": [0, 0, 0],
            "target": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.5,
            "far": 50000,
        },
        "followMode": "follow-position",
        "followTf": ROS_BODY_FRAME,
        "scene": { "transforms": { "showLabel": true, "axisScale": 2, "labelSize": 0.3 } },
        "transforms": {},
        "topics": topics,
        "layers": { "grid": grid },
        "publish": {},
        "imageMode": {},
    })
}

fn map() -> Value {
    json!({
        "foxglovePanelTitle": "Map",
        "center": { "lat": 30.0, "lon": 0.0 },
        "customTileUrl": "",
        "disabledTopics": [],
        "followTopic": "/estimate/fix",
        "layer": "map",
        "topicColors": { "/estimate/fix": COLOURS[0] },
        "zoomLevel": 14,
        "maxNativeZoom": 18,
    })
}

fn events() -> Value {
    json!({
        "foxglovePanelTitle": "Events",
        "topicToRender": "/log",
        "minLogLevel": 1,
        "searchTerms": [],
    })
}

/// The health of the sensors, a row for each.
fn transitions<'a>(sensors: impl Iterator<Item = &'a SensorInfo>) -> Value {
    let paths = sensors.map(|sensor| {
        json!({
            "value": format!("{}.health", lanes::topic(&sensor.name)),
            "label": sensor.name,
            "enabled": true,
            "timestampMethod": "headerStamp",
        })
    });
    json!({
        "foxglovePanelTitle": "Health of the sensors",
        "paths": paths.collect::<Vec<_>>(),
        "isSynced": true,
    })
}

fn path(value: String, label: String, colour: usize, faint: bool) -> Value {
    let colour = COLOURS[colour % COLOURS.len()];
    let colour = if faint { format!("{colour}80") } else { colour.to_owned() };
    json!({
        "value": value,
        "label": label,
        "enabled": true,
        "timestampMethod": "headerStamp",
        "color": colour,
    })
}

fn plot(title: &str, paths: &[Value]) -> Value {
    json!({
        "title": title,
        "foxglovePanelTitle": title,
        "paths": paths,
        "showXAxisLabels": true,
        "showYAxisLabels": true,
        "showLegend": true,
        "legendDisplay": "floating",
        "isSynced": true,
        "xAxisVal": "timestamp",
        "sidebarDimension": 240,
    })
}

/// The error of a block between its bounds of 3 sigma, where the truth is known, or its estimate and
/// sigma.
fn state(block: &Block, compared: bool) -> Value {
    let topic = format!("/state/{}", block.name.replace('.', "/"));
    let mut paths = Vec::new();
    for k in 0..block.operations.tangent {
        let name = block.component(k);
        let what = if compared { "error" } else { "estimate" };
        paths.push(path(format!("{topic}.{what}[{k}]"), format!("{name} {what}"), k, false));
        if compared {
            for factor in [3, -3] {
                let label = format!("{name} {factor:+} sigma");
                paths.push(path(format!("{topic}.sigma[{k}].@mul({factor})"), label, k, true));
            }
        } else {
            paths.push(path(format!("{topic}.sigma[{k}]"), format!("{name} sigma"), k, true));
        }
    }
    let unit = block.spec.display.unit;
    let unit = if unit.is_empty() { String::new() } else { format!(" [{unit}]") };
    let what = if compared { "error and 3 sigma" } else { "estimate and sigma" };
    plot(&format!("{}, {what}{unit}", block.name), &paths)
}

/// The innovations of a sensor and its NIS. A sample without a channel has fewer of them.
fn innovation(sensor: &SensorInfo) -> Value {
    let topic = format!("/innovation/{}", sensor.name);
    let mut paths: Vec<Value> = (0..sensor.channels.len().min(COLOURS.len() - 1))
        .map(|k| {
            let label = sensor.channels[k].name.to_string();
            path(format!("{topic}.innovation[{k}]"), label, k, false)
        })
        .collect();
    paths.push(path(format!("{topic}.nis"), "NIS".to_owned(), COLOURS.len() - 1, false));
    plot(&format!("{}, innovations [SI] and NIS", sensor.name), &paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_have_equal_parts_of_a_column() {
        let panels = ["a", "b", "c"].map(|name| Value::String(name.to_owned()));
        let Some(all) = split("column", panels.to_vec()) else { unreachable!("there are panels") };
        assert_eq!((&all["first"], &all["second"]["second"]), (&json!("a"), &json!("c")));
        let share = all["splitPercentage"].as_f64().unwrap_or(0.0);
        assert!((share - 100.0 / 3.0).abs() < 1e-9 && all["second"]["splitPercentage"] == 50.0);
        assert_eq!(split("row", Vec::new()), None);
        assert_eq!(beside(Path::new("runs/a/run.mcap")), Path::new("runs/a/run.foxglove.json"));
    }
}
