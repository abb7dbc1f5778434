//! A sensor that lags: its Jacobian, its cost, its snapshot, and where the key is refused.

use crate::samples;
use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::record::{Observer, Outcome, UpdateRecord};
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::state::covariance::Update;

const SCENARIO: &str = include_str!("../../../../scenarios/time-offset.toml");

pub(crate) fn assemble(settings: &[&str]) -> Result<Assembly, String> {
    assemble_text(SCENARIO, settings)
}

fn assemble_text(text: &str, settings: &[&str]) -> Result<Assembly, String> {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_simulation::SimulationPlugin);
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let document = Document::parse("test.toml", text).unwrap();
    let scenario = Scenario::new(&registry, document, &settings).unwrap();
    scenario.assemble(None).map_err(|e| e.to_string())
}

/// The last innovation and Jacobian.
#[derive(Default)]
struct Log {
    innovation: Vec<f64>,
    columns: Vec<usize>,
    h: Vec<f64>,
    accepted: usize,
}

impl Observer for Log {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.innovation.clear();
        self.innovation.extend_from_slice(update.innovation);
        self.accepted += usize::from(update.outcome == Outcome::Accepted);
    }
    fn correction(&mut self, update: &Update) {
        self.columns.clone_from(&update.columns);
        self.h.clone_from(&update.h);
    }
}

/// A filter in a turn, started from the values of `changed` instead of its own, two seconds before
/// its one velocity: the filter just before that, and what the velocity told it.
fn first_velocity(changed: &str) -> (Ekf, Log) {
    let settings = [
        "estimator.start=\"190 s\"",
        "estimator.initial=\"given\"",
        "estimator.draw=\"nothing\"",
        "process.ins.attitude={ initial = [\"2 deg\", \"-3 deg\", \"50 deg\"], sigma = \"1 deg\" }",
        "process.ins.velocity={ initial = [\"3 m/s\", \"2 m/s\", \"0.4 m/s\"], sigma = \"1 m/s\" }",
        "process.ins.position={ latitude = \"30 deg\", longitude = \"10 deg\", height = \"-20 m\", \
         sigma = \"10 m\" }",
        "sensor.dvl.time_offset={ initial = \"0.3 s\", sigma = \"0.3 s\", truth = \"0.3 s\" }",
        "sensor.dvl.gate=\"off\"",
        "sensor.reference.enabled=false",
        // the filter mistakes less of the noise for motion than differences of whole filters do
        "sensor.imu.simulation.noise=0",
        changed,
    ];
    let mut assembly = assemble(&settings).unwrap();
    let all = samples(&mut assembly, 192.01);
    let dvl = assembly.composition.sensor("dvl").unwrap();
    let mut ekf = Ekf::new(assembly.composition);
    let mut log = Log::default();
    for sample in all.iter().filter(|s| s.sensor.0 != dvl) {
        ekf.process(sample, &mut log).unwrap();
    }
    let velocity = all.iter().rfind(|s| s.sensor.0 == dvl).unwrap();
    assert_eq!(velocity.time, ekf.state().time);
    let before = ekf.snapshot();
    ekf.process(velocity, &mut log).unwrap();
    ekf.restore(&before);
    (ekf, log)
}

/// Whole filters, each started a little apart from the other: what they predict differs as the
/// Jacobian says of how their states differ when the sample comes, the lag among them.
#[test]
fn the_jacobian_is_the_change_of_the_prediction_with_the_state_when_the_sample_comes() {
    let (_, nominal) = first_velocity("seed=1");
    let w = nominal.columns.len();
    let pairs =
        |key: &str, two: [&str; 2]| two.map(|value| first_velocity(&format!("{key}={value}")));
    let offset =
        |t: &str| format!("{{ initial = \"{t} s\", sigma = \"0.3 s\", truth = \"0.3 s\" }}");
    let given = |values: &str| format!("{{ initial = [{values}], sigma = \"1 deg\" }}");
    let moving = |values: &str| format!("{{ initial = [{values}], sigma = \"1 m/s\" }}");
    let bias =
        |value: &str| format!("{{ initial = \"{value}\", sigma = \"50 ug\", truth = \"0 mg\" }}");
    let angles =
        |values: [&str; 2]| pairs("process.ins.attitude", [&given(values[0]), &given(values[1])]);
    let scales = [
        "{ initial = 1.001, sigma = 0.1, truth = 1 }",
        "{ initial = 0.999, sigma = 0.1, truth = 1 }",
    ];
    let cases = [
        ("offset", pairs("sensor.dvl.time_offset", [&offset("0.301"), &offset("0.299")])),
        (
            "roll",
            angles([r#""2.01 deg", "-3 deg", "50 deg""#, r#""1.99 deg", "-3 deg", "50 deg""#]),
        ),
        (
            "pitch",
            angles([r#""2 deg", "-2.99 deg", "50 deg""#, r#""2 deg", "-3.01 deg", "50 deg""#]),
        ),
        (
            "heading",
            angles([r#""2 deg", "-3 deg", "50.01 deg""#, r#""2 deg", "-3 deg", "49.99 deg""#]),
        ),
        (
            "velocity",
            pairs(
                "process.ins.velocity",
                [
                    &moving(r#""3.01 m/s", "2 m/s", "0.41 m/s""#),
                    &moving(r#""2.99 m/s", "2 m/s", "0.39 m/s""#),
                ],
            ),
        ),
        ("accelerometers", pairs("process.ins.accel_bias", [&bias("1 mg"), &bias("-1 mg")])),
        ("scale", pairs("sensor.dvl.scale", scales)),
    ];
    for (what, [(a, above), (b, below)]) in &cases {
        let layout = a.layout();
        let mut error = vec![0.0; layout.tangent];
        layout.error(a.state(), b.state(), &vec![true; layout.blocks.len()], &mut error);
        let change: Vec<f64> = (0..3).map(|i| below.innovation[i] - above.innovation[i]).collect();
        let told: Vec<f64> = (0..3)
            .map(|i| {
                nominal.columns.iter().zip(&nominal.h[i * w..]).map(|(&c, h)| h * error[c]).sum()
            })
            .collect();
        let size = change.iter().fold(0.0_f64, |a, c| a.max(c.abs()));
        let worst = change.iter().zip(&told).fold(0.0_f64, |a, (c, t)| a.max((c - t).abs())) / size;
        println!("{what}: {change:?}, {told:?}, {worst:.1e}");
        // Phi is led back to first order of the delay: what is left out is of the order of the
        // angle turned in it, 15 mrad, times what the delay itself changes
        assert!(worst < 1e-3, "{what}: {change:?} {told:?}");
    }
}

/// At constant velocity the time of a velocity sample does not matter: 3000 samples carry no
/// information about the lag, however noisy the IMU that propagates the state between them. Noise
/// of 500 ug/sqrt(Hz) is an acceleration of 1 cm/s^2 over 0.2 s; mistaken for motion, this
/// acceleration would reduce the sigma from the prior's 0.3 s to 0.02 s. A slope counts only if its
/// chi-square of three channels exceeds 15, against a mean of 3 from noise: 1/4000 of that
/// information, which leaves 0.29 s.
#[test]
fn a_time_offset_is_unobservable_at_constant_velocity() {
    let settings = [
        "source.simulation.segments=[{ type = \"static\", duration = \"60 s\" }, \
         { type = \"cruise\", duration = \"600 s\" }]",
        "sensor.imu.accel_noise=\"500 ug/sqrt(Hz)\"",
        "sensor.dvl.time_offset={ sigma = \"0.3 s\", truth = \"0.3 s\" }",
    ];
    let mut assembly = assemble(&settings).unwrap();
    let all = samples(&mut assembly, 660.0);
    let mut ekf = Ekf::new(assembly.composition);
    let mut log = Log::default();
    all.iter().for_each(|s| ekf.process(s, &mut log).unwrap());
    let column = ekf.layout().find("dvl.time_offset").unwrap().tangent.unwrap();
    let sigma = ekf.covariance().get(column, column).sqrt();
    println!("sigma {sigma} s after {} velocities", log.accepted);
    assert!(log.accepted > 2900 && sigma > 0.27, "{sigma}");
}

#[test]
fn a_step_with_a_time_offset_allocates_nothing() {
    let mut assembly = assemble(&[]).unwrap();
    let all = samples(&mut assembly, 120.0);
    let mut ekf = Ekf::new(assembly.composition);
    let mut log = Log::default();
    let warm = all.iter().position(|s| s.time.seconds() > 63.0).unwrap();
    all[..warm].iter().for_each(|s| ekf.process(s, &mut log).unwrap());
    assert!(ekf.running());
    let info = allocation_counter::measure(|| {
        all[warm..].iter().for_each(|s| ekf.process(s, &mut log).unwrap())
    });
    assert!(log.accepted > 250, "{}", log.accepted);
    assert_eq!(info.count_total, 0, "{} bytes in {} steps", info.bytes_total, all.len() - warm);
}

#[test]
fn a_run_with_a_time_offset_continues_from_a_snapshot_to_the_bit() {
    let mut assembly = assemble(&[]).unwrap();
    let all = samples(&mut assembly, 100.0);
    let mut ekf = Ekf::new(assembly.composition);
    let mut log = Log::default();
    let cut = all.len() - 2001;
    all[..cut].iter().for_each(|s| ekf.process(s, &mut log).unwrap());
    let snapshot = ekf.snapshot();
    all[cut..].iter().for_each(|s| ekf.process(s, &mut log).unwrap());
    let (state, covariance) = (ekf.state().clone(), ekf.covariance().into_owned());
    ekf.restore(&snapshot);
    all[cut..].iter().for_each(|s| ekf.process(s, &mut log).unwrap());
    assert_eq!((ekf.state(), &*ekf.covariance()), (&state, &covariance));
}

/// An offset that is known to be zero is none: the same samples, and the same estimates but for the
/// rounding of reading the state from the history.
#[test]
fn an_offset_of_zero_is_no_offset() {
    let end = |text: &str, settings: &[&str]| {
        let mut assembly = assemble_text(text, settings).unwrap();
        let all = samples(&mut assembly, 110.0);
        let mut ekf = Ekf::new(assembly.composition);
        all.iter().for_each(|s| ekf.process(s, &mut Log::default()).unwrap());
        (all, ekf)
    };
    let lines: Vec<&str> = SCENARIO.lines().filter(|l| !l.starts_with("time_offset")).collect();
    assert_eq!(lines.len() + 1, SCENARIO.lines().count());
    let (samples, none) = end(&lines.join("\n"), &[]);
    let (same, zero) = end(SCENARIO, &["sensor.dvl.time_offset=\"0 s\""]);
    assert_eq!(samples, same);
    let mut error = vec![0.0; none.layout().tangent];
    // the one block more is fixed, and the last
    let known = vec![true; none.layout().blocks.len()];
    none.layout().error(none.state(), zero.state(), &known, &mut error);
    let worst = error.iter().fold(0.0_f64, |a, e| a.max(e.abs()));
    // the first sample, at the very start, is left out where there is an offset: there is no motion
    // yet to tell it by
    println!("{error:?}");
    assert!(worst < 1e-2, "{worst}");
}

#[test]
fn a_time_offset_is_refused_where_it_means_nothing() {
    let refused =
        |setting: &str| assemble(&[setting]).err().unwrap_or_else(|| panic!("{setting} was taken"));
    for sensor in ["imu", "reference"] {
        let message = refused(&format!("sensor.{sensor}.time_offset=\"0.1 s\""));
        assert!(
            message.contains("only a sensor that corrects the state has a time offset"),
            "{message}"
        );
    }
    let message = refused("sensor.dvl.time_offset={ sigma = \"3 s\" }");
    assert!(message.contains("beyond 10 s, the longest delay"), "{message}");
    let message = refused("sensor.dvl.time_offset=\"0.1 m\"");
    assert!(message.contains("a time is needed"), "{message}");
}
