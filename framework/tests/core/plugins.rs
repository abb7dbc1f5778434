//! Plugins as the author of a program combines them: groups, members that are replaced, disabled
//! and configured, and the errors of combinations that do not fit.

use navfuse_core::document::Document;
use navfuse_core::plugin::{Kind, Need};
use navfuse_core::prelude::*;
use navfuse_core::run::scenario::Scenario;
use navfuse_testing::lab::{Lab, SCENARIO};

/// A sensor of a type that only stands in the registry.
#[derive(Debug, Deserialize, JsonSchema)]
struct Sonar {}

impl SensorType for Sonar {
    const TYPE: &'static str = "sonar";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("range", "m")]
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Err(ComposeError::new("range", "never composed"))
    }
}

/// The same under the same name, by somebody else.
#[derive(Debug, Deserialize, JsonSchema)]
struct BetterSonar {
    /// What it can more.
    #[allow(dead_code, reason = "read from TOML, to be told from the other")]
    beams: u8,
}

impl SensorType for BetterSonar {
    const TYPE: &'static str = "sonar";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("range", "m")]
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Err(ComposeError::new("range", "never composed"))
    }
}

/// A compass that is registered only where it is switched on.
#[derive(Debug, Deserialize, JsonSchema)]
struct Compass {}

impl SensorType for Compass {
    const TYPE: &'static str = "compass";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("heading", "rad")]
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Err(ComposeError::new("heading", "never composed"))
    }
}

struct SonarPlugin;
impl Plugin for SonarPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Sonar>();
    }
    fn name(&self) -> &'static str {
        "sonar"
    }
    fn version(&self) -> &'static str {
        "0.3.1"
    }
}

struct BetterSonarPlugin;
impl Plugin for BetterSonarPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<BetterSonar>();
    }
    fn name(&self) -> &'static str {
        "better-sonar"
    }
}

struct CompassPlugin {
    compass: bool,
}
impl Plugin for CompassPlugin {
    fn build(&self, registry: &mut Registry) {
        if self.compass {
            registry.sensor::<Compass>();
        }
    }
}

/// Two plugins as one.
struct Acoustics;
impl Plugin for Acoustics {
    fn build(&self, registry: &mut Registry) {
        registry.add(&SonarPlugin).add(&CompassPlugin { compass: false });
    }
}

struct Needing(Need);
impl Plugin for Needing {
    fn build(&self, _: &mut Registry) {}
    fn name(&self) -> &'static str {
        "terrain"
    }
    fn version(&self) -> &'static str {
        "1.2.0"
    }
    fn needs(&self) -> &[Need] {
        std::slice::from_ref(&self.0)
    }
}

fn names(registry: &Registry) -> Vec<&str> {
    registry.entries().map(|e| &*e.name).collect()
}

fn wrong(registry: &Registry) -> String {
    registry.check().unwrap_err().to_string()
}

/// Whether the sonar is the one with beams.
fn better(registry: &Registry) -> bool {
    let schema =
        serde_json::to_string(&*registry.get(Kind::Sensor, "sonar").unwrap().schema).unwrap();
    schema.contains("beams")
}

#[test]
fn a_group_is_a_plugin_that_adds_others() {
    let mut registry = Registry::new();
    registry.add(&Acoustics);
    assert_eq!(names(&registry), ["sonar"]);
    registry.check().unwrap();
}

#[test]
fn a_member_of_a_group_is_replaced_disabled_and_configured() {
    let mut registry = Registry::new();
    registry
        .add(&Acoustics)
        .replace::<SonarPlugin>(&BetterSonarPlugin)
        .set(&CompassPlugin { compass: true });
    assert_eq!(names(&registry), ["compass", "sonar"]);
    assert!(better(&registry));
    registry.disable::<BetterSonarPlugin>();
    assert_eq!(names(&registry), ["compass"]);
    registry.check().unwrap();
}

/// A plugin that adds itself once more.
struct Again {
    more: bool,
}
impl Plugin for Again {
    fn build(&self, registry: &mut Registry) {
        if self.more {
            registry.add(&Self { more: false });
        }
    }
}

#[test]
fn a_plugin_that_adds_itself_is_told_and_can_be_disabled() {
    let mut registry = Registry::new();
    registry.add(&Again { more: true });
    assert!(wrong(&registry).contains("is added twice"), "{}", wrong(&registry));
    registry.disable::<Again>();
    registry.check().unwrap();
}

#[test]
fn what_replaces_a_member_of_a_group_is_one() {
    let mut registry = Registry::new();
    registry.add(&Acoustics).replace::<SonarPlugin>(&BetterSonarPlugin).disable::<Acoustics>();
    assert_eq!(names(&registry), [""; 0]);
    registry.check().unwrap();
}

#[test]
fn a_group_is_disabled_with_its_members() {
    let mut registry = Registry::new();
    registry.add(&Acoustics).add(&BetterSonarPlugin).disable::<Acoustics>();
    assert!(better(&registry));
    registry.check().unwrap();
}

#[test]
fn a_type_that_two_plugins_register_is_told_with_both_and_mended_by_disabling_either() {
    let both = || {
        let mut registry = Registry::new();
        registry.add(&SonarPlugin).add(&BetterSonarPlugin);
        registry
    };
    let error = "better-sonar registers the sensor type \"sonar\", which sonar has registered; \
                 rename it, or `replace` the plugin";
    assert_eq!(wrong(&both()), error);
    for keep_the_better in [true, false] {
        let mut registry = both();
        if keep_the_better {
            registry.disable::<SonarPlugin>();
        } else {
            registry.disable::<BetterSonarPlugin>();
        }
        registry.check().unwrap();
        assert_eq!(better(&registry), keep_the_better);
    }
    // a program that registers a type by itself
    let mut registry = Registry::new();
    registry.add(&SonarPlugin);
    registry.sensor::<BetterSonar>();
    assert!(
        wrong(&registry)
            .starts_with("this program registers the sensor type \"sonar\", which sonar has")
    );
}

#[test]
fn a_plugin_that_is_added_twice_is_told_once() {
    let mut registry = Registry::new();
    registry.add(&Acoustics).add(&SonarPlugin);
    assert_eq!(
        wrong(&registry),
        "the plugin sonar is added twice; add it once, or `set` it for other settings"
    );
}

#[test]
fn a_plugin_that_is_needed_and_not_there_is_told_and_so_is_a_wrong_version() {
    let terrain = |plugin: &'static str, version: &'static str| {
        let mut registry = Registry::new();
        registry.add(&SonarPlugin).add(&Needing(Need { plugin, version }));
        registry
    };
    terrain("sonar", "0.3").check().unwrap();
    terrain("navfuse-core", env!("CARGO_PKG_VERSION")).check().unwrap();
    let told = "the plugin terrain 1.2.0 needs the plugin ";
    assert_eq!(
        wrong(&terrain("lidar", "2")),
        format!("{told}lidar 2, which is not there; add that one, or disable this")
    );
    assert_eq!(
        wrong(&terrain("sonar", "0.4")),
        format!("{told}sonar 0.4, but 0.3.1 is there; take versions that fit together")
    );
    assert!(
        wrong(&terrain("navfuse-core", ">=99"))
            .starts_with(&format!("{told}navfuse-core >=99, but "))
    );
    assert!(
        wrong(&terrain("sonar", "new"))
            .starts_with(&format!("{told}sonar in the version \"new\", which is none"))
    );
}

#[test]
fn what_is_replaced_and_is_not_there_is_told() {
    let mut registry = Registry::new();
    registry.replace::<SonarPlugin>(&BetterSonarPlugin);
    let message = wrong(&registry);
    assert!(
        message.contains("SonarPlugin is to be replaced or disabled, but is no plugin here"),
        "{message}"
    );
}

/// A plugin without a version of its own is of the crate that declares the interface.
#[test]
fn a_plugin_without_a_version_has_that_of_the_framework() {
    assert_eq!(CompassPlugin { compass: true }.version(), env!("CARGO_PKG_VERSION"));
    assert!(CompassPlugin { compass: true }.name().ends_with("plugins::CompassPlugin"));
}

#[derive(Debug, Deserialize, JsonSchema)]
struct Log {}

impl SourceType for Log {
    const TYPE: &'static str = "log";
    fn open(self, _: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        Err(StreamError::new("never opened"))
    }
}

/// A sink that records every run, and one that a scenario asks for.
macro_rules! sink {
    ($sink:ident, $name:literal, $default:literal) => {
        #[derive(Clone, Debug, Deserialize, JsonSchema)]
        struct $sink {}

        impl SinkType for $sink {
            const TYPE: &'static str = $name;
            const DEFAULT: bool = $default;
            fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
                Err(StreamError::new("never opened"))
            }
        }
    };
}

sink!(Table, "table", true);
sink!(Viewer, "viewer", false);

#[test]
fn the_sinks_of_a_type_are_those_named_and_the_default_one_if_none_is() {
    let mut registry = Registry::new();
    registry.sink::<Table>();
    registry.sink::<Viewer>();
    let sinks = |text: &str, kind: &str| {
        let document = Document::parse("sinks.toml", text).unwrap();
        Scenario::new(&registry, document, &[]).unwrap().sinks_of_type(kind).unwrap()
    };
    let two = "[sink.screen]\ntype = \"viewer\"\n[sink.viewer]\n[sink.all]\ntype = \"table\"\n";
    let mut viewers = sinks(two, "viewer");
    viewers.sort_unstable();
    assert_eq!(
        (viewers, sinks(two, "table")),
        (vec!["screen".into(), "viewer".into()], vec!["all".to_owned()])
    );
    assert_eq!((sinks("", "viewer").len(), sinks("", "table")), (0, vec!["table".to_owned()]));
}

#[test]
fn a_run_without_a_source_is_refused_with_the_types_of_sources() {
    let mut registry = Registry::new();
    registry.add(&Lab);
    registry.source::<Log>();
    registry.sink::<Table>();
    let document = Document::parse("lab.toml", SCENARIO).unwrap();
    let scenario = Scenario::new(&registry, document, &[]).unwrap();
    let message = scenario.assemble(None).err().unwrap().to_string();
    assert!(message.ends_with("no source of samples: add one of [source.log]"), "{message}");
}
