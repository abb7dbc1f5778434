//! The current profiler: the current between its layers, and a dive through them without the bottom.

use crate::common::{compose, predict, refused, set};
use navfuse_core::nalgebra::Vector3;
use navfuse_core::session::Finished;
use navfuse_core::session::summary::StateRow;
use navfuse_core::state::State;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_testing::judge::judged;

const DIVE: &str = r#"
[estimator]
draw = "all"
[process.ins]
attitude = { sigma = ["0.05 deg", "0.05 deg", "0.5 deg"] }
velocity = { sigma = "10 cm/s" }
position = { sigma = "1 m", latitude = "43 deg", longitude = "5 deg", height = "0 m" }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "200 ug" }
[sensor.imu]
gyro_noise = "0.5 deg/h/sqrt(Hz)"
accel_noise = "50 ug/sqrt(Hz)"
simulation = { rate = "20 Hz" }
[sensor.depth]
noise = "5 cm"
simulation = { rate = "1 Hz" }
[sensor.adcp]
type = "water-profile"
noise = "2 cm/s"
layers = ["5 m", "20 m", "50 m", "80 m"]
current = { sigma = "30 cm/s", correlation_time = "2 h" }
gate = "off"
simulation = { rate = "0.5 Hz", cells = 8, first = "3 m", size = "4 m" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "43 deg", longitude = "5 deg", heading = "30 deg" }
segments = [
    { type = "surge", duration = "20 s", speed = "1.5 m/s" },
    { type = "descend", duration = "150 s", rate = "0.4 m/s" },
    { type = "turn", duration = "30 s", angle = "90 deg" },
    { type = "cruise", duration = "50 s" },
]
"#;

fn sample(distance: f64) -> Sample {
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    sample.set(3, distance);
    sample
}

#[test]
fn the_current_is_linear_between_layers_and_constant_beyond() {
    let composition = compose(DIVE, &["sensor.adcp.surface=2 m"]);
    let mut state = composition.layout.initial_state();
    // heading east at 2 m/s, 10 m below the ellipsoid, 12 m below the surface
    set(&composition, &mut state, "ins.position", &[0.75, 0.1, -10.0]);
    set(&composition, &mut state, "ins.attitude", &[0.0, 0.0, 90_f64.to_radians()]);
    set(&composition, &mut state, "ins.velocity", &[0.0, 2.0, 0.0]);
    set(&composition, &mut state, "adcp.current_1", &[0.3, 0.5, 0.0]);
    set(&composition, &mut state, "adcp.current_2", &[0.1, -0.1, 0.1]);
    set(&composition, &mut state, "adcp.current_4", &[-0.4, 0.0, 0.0]);
    let at = |state: &State, distance| {
        Vector3::from_vec(predict(&composition, "adcp", state, &sample(distance)))
    };
    // forward is east, right is south; 6 m below, at 18 m, are 13/15 of the way from 5 to 20 m
    let share = 13.0 / 15.0;
    let current =
        Vector3::new(0.3, 0.5, 0.0) * (1.0 - share) + Vector3::new(0.1, -0.1, 0.1) * share;
    let expected = Vector3::new(2.0 - current.y, current.x, -current.z);
    assert!((at(&state, 6.0) - expected).amax() < 1e-12, "{}", at(&state, 6.0));
    // above the first layer, by an instrument that looks up, and below the last
    assert!((at(&state, -9.0) - Vector3::new(1.5, 0.3, 0.0)).amax() < 1e-12);
    assert!((at(&state, 100.0) - Vector3::new(2.0, -0.4, 0.0)).amax() < 1e-12);
    // pitched up by 60 deg, the cell 12 m along the down axis is 6 m below
    set(&composition, &mut state, "ins.attitude", &[0.0, 60_f64.to_radians(), 90_f64.to_radians()]);
    let pitched = at(&state, 12.0);
    assert!((pitched.y - current.x).abs() < 1e-12, "{pitched}");
}

#[test]
fn layers_that_do_not_increase_are_refused() {
    let text = refused(DIVE, &["sensor.adcp.layers=['20 m', '5 m']"]);
    assert!(text.contains("layers") && text.contains("increase"), "{text}");
    assert!(refused(DIVE, &["sensor.adcp.layers=[]"]).contains("at least one depth"));
}

/// 27 states, so that the mean NEES of 20 runs has a sigma of sqrt(2 / (20 * 27)) = 0.061 of its mean, and the
/// mean NIS of 20 * 8 * 124 cells of three axes one of 0.006; 3.3 sigma. The profile at the surface is tied
/// to the velocity of the start, each deeper layer to the one above, which the same ping sees.
#[test]
fn a_dive_through_layers_is_consistent_and_hands_the_velocity_down() {
    let (mut nees, mut nis, mut sigma, mut error) = (0.0, 0.0, 0.0, 0.0);
    for seed in 1..=20 {
        let (finished, judge) =
            judged(&navfuse_testing::registry(), DIVE, &[format!("seed={seed}")]);
        assert!(finished.error.is_none(), "seed {seed}: {:?}", finished.error);
        assert_eq!(judge.freedom, 27, "seed {seed}");
        nees += judge.nees / (20.0 * 27.0);
        let adcp = &finished.summary.samples["adcp"];
        assert!(adcp["accepted"].as_u64().unwrap() > 900, "{adcp}");
        nis += adcp["mean_nis"].as_f64().unwrap() / (20.0 * 3.0);
        sigma += squares(&position(&finished).error_sigma);
        error += squares(position(&finished).error.as_ref().unwrap());
    }
    let (sigma, error) = ((sigma / 20.0).sqrt(), (error / 20.0).sqrt());
    let without = ["sensor.adcp.enabled=false".to_owned()];
    let (finished, _) = judged(&navfuse_testing::registry(), DIVE, &without);
    let alone = squares(&position(&finished).error_sigma).sqrt();
    println!("ANEES {nees:.3}, ANIS {nis:.4}, error {error:.1} m, sigma {sigma:.1} m at 250 s");
    println!("without the profiler {alone:.0} m");
    assert!((nees - 1.0).abs() < 0.21, "{nees}");
    assert!((nis - 1.0).abs() < 0.02, "{nis}");
    // the velocity of the start, 10 cm/s, alone is 25 m
    assert!(sigma > 25.0 && alone > 5.0 * sigma, "{sigma} {alone}");
}

/// One cell in twenty is off by 20 sigma. The band is that of the test above.
#[test]
fn one_outlier_in_twenty_leaves_the_dive_consistent() {
    let text =
        DIVE.replace("gate = \"off\"\n", "").replace("cells = 8", "outliers = \"5 %\", cells = 8");
    let of = |seed| {
        let settings = [format!("seed={seed}")];
        let (finished, judge) = judged(&navfuse_testing::registry(), &text, &settings);
        assert!(finished.error.is_none(), "seed {seed}: {:?}", finished.error);
        judge.nees / (20.0 * 27.0)
    };
    let nees: f64 = (1..=20).map(of).sum();
    println!("ANEES {nees:.3}");
    assert!((nees - 1.0).abs() < 0.21, "{nees}");
}

fn position(finished: &Finished) -> &StateRow {
    finished.summary.rows.iter().find(|row| row.name == "ins.position").unwrap()
}

fn squares(of: &[f64]) -> f64 {
    of[..2].iter().map(|s| s * s).sum()
}
