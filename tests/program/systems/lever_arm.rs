//! Tang, Wu, Wu, Wu, Hu & Shen (2009), *INS/GPS integration: global observability analysis*: which
//! motions determine the heading and the lever arm of the antenna.

use super::over_runs;
use navfuse_core::nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::session::Finished;
use navfuse_segments::LeverArm;
use navfuse_testing::scenario;
use std::sync::atomic::AtomicBool;

/// An aircraft with an antenna whose place is known to 1 m, and a heading known to 5 deg.
fn flight(segments: &str) -> String {
    format!(
        r#"
        [estimator]
        draw = "all"
        [process.ins]
        attitude = {{ sigma = ["0.1 deg", "0.1 deg", "2 deg"] }}
        velocity = {{ sigma = "10 cm/s" }}
        position = {{ sigma = "3 m" }}
        gyro_bias = {{ sigma = "1 deg/h" }}
        accel_bias = {{ sigma = "200 ug" }}
        [sensor.imu]
        gyro_noise = "1 deg/h/sqrt(Hz)"
        accel_noise = "50 ug/sqrt(Hz)"
        simulation = {{ rate = "50 Hz" }}
        [sensor.gnss]
        horizontal_noise = "1 m"
        vertical_noise = "1 m"
        lever_arm = {{ sigma = "1 m" }}
        simulation = {{ rate = "5 Hz" }}
        [sensor.reference]
        simulation = {{ rate = "5 Hz" }}
        [source.simulation]
        start = {{ latitude = "45 deg", height = "500 m", heading = "30 deg", speed = "30 m/s" }}
        segments = [ {segments} ]
        "#
    )
}

const FLIGHTS: [(&str, usize, &str); 4] = [
    ("straight, constant speed", 0, r#"{ type = "cruise", duration = "240 s" }"#),
    (
        "straight, changes of speed",
        0,
        r#"{ type = "cruise", duration = "60 s" }, { type = "surge", duration = "30 s", speed = "60 m/s" },
           { type = "cruise", duration = "30 s" }, { type = "surge", duration = "30 s", speed = "30 m/s" },
           { type = "cruise", duration = "90 s" }"#,
    ),
    (
        "flat turns",
        2,
        r#"{ type = "cruise", duration = "60 s" }, { type = "turn", duration = "60 s", angle = "180 deg", bank = "0 deg" },
           { type = "turn", duration = "60 s", angle = "-180 deg", bank = "0 deg" }, { type = "cruise", duration = "60 s" }"#,
    ),
    (
        "banked turns",
        3,
        r#"{ type = "cruise", duration = "60 s" }, { type = "turn", duration = "60 s", angle = "180 deg", bank = "30 deg" },
           { type = "turn", duration = "60 s", angle = "-180 deg", bank = "-30 deg" }, { type = "cruise", duration = "60 s" }"#,
    ),
];

/// The attitudes of the reference, and the sigma of the heading (deg) and the lever arm (m) at the end.
fn fly(segments: &str) -> (Vec<UnitQuaternion<f64>>, f64, Vector3<f64>) {
    let text = flight(segments);
    let attitudes = scenario(&text, &[], |scenario| {
        let mut assembly = scenario.assemble(None).unwrap();
        let reference = assembly.composition.sensor("reference").unwrap();
        let (mut attitudes, mut sample) =
            (Vec::new(), navfuse_core::units::sample::Sample::default());
        for (_, source) in &mut assembly.sources {
            while source.next(&mut sample).unwrap() {
                let angles = (sample.sensor.0 == reference).then(|| sample.array::<3>(6)).flatten();
                attitudes
                    .extend(angles.map(|[r, p, y]| UnitQuaternion::from_euler_angles(r, p, y)));
            }
        }
        attitudes
    });
    let finished: Finished = scenario(&text, &[], |scenario| {
        let assembly = scenario.assemble(None).unwrap();
        navfuse_core::run::runner::run(assembly, &AtomicBool::new(false), |_| {})
    });
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let sigma =
        |name: &str| finished.summary.rows.iter().find(|r| r.name == name).unwrap().sigma.clone();
    let arm = sigma("gnss.lever_arm");
    (attitudes, sigma("ins.attitude")[2], Vector3::new(arm[0], arm[1], arm[2]))
}

/// What the analysis promises, before any filter runs: the number of axes along which the lever arm is
/// determined, and that changes of the horizontal acceleration determine the heading. The filter agrees
/// where the lever arm keeps its prior of 1 m and where it does not.
#[test]
fn the_segments_of_a_flight_determine_heading_and_lever_arm() {
    println!(
        "| flight | axes of the lever arm | sigma of the analysis | filter: lever arm | heading |"
    );
    println!("|---|---|---|---|---|");
    let mut headings = Vec::new();
    for (name, rank, segments) in FLIGHTS {
        let (attitudes, heading, arm) = fly(segments);
        let analysis = LeverArm::of(&attitudes).unwrap();
        assert_eq!(analysis.rank, rank, "{name}: {analysis:?}");
        let expected = analysis.sigma(1.0, attitudes.len());
        let text = |v: &Vector3<f64>| {
            let text = |x: &f64| if x.is_finite() { format!("{x:.3}") } else { "prior".to_owned() };
            v.iter().map(text).collect::<Vec<_>>().join(", ")
        };
        println!(
            "| {name} | {rank} | {} m | {} m | {heading:.3} deg |",
            text(&expected),
            text(&arm)
        );
        // along its axes, in the order of the analysis
        let along =
            |k: usize| over_runs(arm.component_mul(&analysis.axes.column(k)).iter().copied());
        for k in 0..3 {
            let sigma = along(k) * 3.0_f64.sqrt();
            if k < rank {
                assert!(sigma < 0.7, "{name}, axis {k}: {sigma}");
            } else {
                assert!(sigma > 0.9, "{name}, axis {k}: {sigma}");
            }
        }
        headings.push(heading);
    }
    assert!(headings[0] > 3.0 * headings[1], "{headings:?}");
    assert!(headings[2].max(headings[3]) < headings[1], "{headings:?}");
}
