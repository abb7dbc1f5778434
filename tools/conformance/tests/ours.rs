//! Our own plugins conform.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use navfuse_conformance::{Failed, check};
use navfuse_core::document::Document;
use navfuse_core::plugin::{Plugin, Registry};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Scenario of 90 s of a vehicle that surges, descends and turns, with the given sensor.
fn scenario(sensor: &str) -> String {
    format!(
        r#"
        [process.ins]
        attitude = {{ sigma = ["0.02 deg", "0.02 deg", "0.2 deg"] }}
        velocity = {{ sigma = "1 cm/s" }}
        position = {{ sigma = "1 m" }}
        gyro_bias = {{ sigma = "1 deg/h" }}
        accel_bias = {{ sigma = "100 ug" }}

        [sensor.imu]
        gyro_noise = "0.1 deg/h/sqrt(Hz)"
        accel_noise = "10 ug/sqrt(Hz)"
        simulation = {{ rate = "50 Hz" }}

        [sensor.reference]
        simulation = {{ rate = "1 Hz" }}

        [source.simulation]
        start = {{ latitude = "43 deg", heading = "30 deg" }}
        segments = [
            {{ type = "surge", duration = "20 s", speed = "2 m/s" }},
            {{ type = "descend", duration = "30 s", rate = "0.5 m/s" }},
            {{ type = "turn", duration = "20 s", angle = "90 deg", bank = "8 deg" }},
            {{ type = "cruise", duration = "20 s" }},
        ]
        {sensor}
        "#
    )
}

fn conforms(plugin: &dyn Plugin, sensor: &str) -> Result<(), Failed> {
    check(&[plugin], &scenario(sensor))
}

#[test]
fn the_imu_the_strapdown_process_and_the_reference_conform() -> Result<(), Failed> {
    conforms(&navfuse_ins::InsPlugin, "")?;
    conforms(
        &navfuse_ins::InsPlugin,
        r#"
        [process.ins.gravity_disturbance]
        sigma = "50 ug"
        [sensor.imu.gyro_scale]
        sigma = "300 ppm"
        [sensor.imu.accel_misalignment]
        sigma = "0.5 mrad"
        "#,
    )
}

#[test]
fn the_dvl_conforms() -> Result<(), Failed> {
    conforms(
        &navfuse_doppler::DvlPlugin,
        r#"
        [sensor.dvl]
        noise = "1 cm/s"
        bias = { sigma = "1 cm/s" }
        scale = { sigma = "1 %" }
        misalignment = { sigma = "0.5 deg" }
        lever_arm = ["0.3 m", "0 m", "0.2 m"]
        sound_speed = { set = "1500 m/s", array = "phased", water = { temperature = 8 } }
        simulation = { rate = "2 Hz" }
        "#,
    )
}

#[test]
fn the_dvl_by_beams_conforms() -> Result<(), Failed> {
    conforms(
        &navfuse_doppler::DvlPlugin,
        r#"
        [sensor.dvl-beams]
        noise = "1 cm/s"
        scale = { sigma = "1 %" }
        misalignment = { sigma = "0.5 deg" }
        lever_arm = { initial = ["0.3 m", "0 m", "0.2 m"], sigma = "2 cm" }
        simulation = { rate = "2 Hz" }
        "#,
    )
}

#[test]
fn the_laser_doppler_conforms_with_one_two_and_three_beams() -> Result<(), Failed> {
    for beams in ["[[1, 0, 1]]", "[[1, 0, 1], [-1, 0, 1]]", "[[1, 0, 1], [-1, 0, 1], [0, 1, 1]]"] {
        let sensor = format!(
            r#"
            [sensor.laser-doppler]
            beams = {beams}
            noise = "5 mm/s"
            scale = {{ sigma = "0.5 %" }}
            misalignment = {{ sigma = "0.3 deg" }}
            lever_arm = ["0.3 m", "0 m", "0.2 m"]
            simulation = {{ rate = "2 Hz" }}
            "#
        );
        conforms(&navfuse_doppler::LaserDopplerPlugin, &sensor)?;
    }
    Ok(())
}

#[test]
fn gnss_conforms() -> Result<(), Failed> {
    conforms(
        &navfuse_gnss::GnssPlugin,
        r#"
        [sensor.gnss]
        horizontal_noise = "1 m"
        vertical_noise = "2 m"
        velocity_noise = "5 cm/s"
        bias = { sigma = ["1 m", "1 m", "2 m"], correlation_time = "10 min" }
        lever_arm = { initial = ["-0.4 m", "0 m", "-0.8 m"], sigma = "10 cm" }
        simulation = { rate = "1 Hz" }
        "#,
    )?;
    conforms(
        &navfuse_gnss::GnssPlugin,
        r#"
        [process.receiver-clock]
        offset = "30 m"
        drift = "1 m/s"
        offset_noise = "10 cm/sqrt(s)"
        drift_noise = "5 cm/s^2/sqrt(Hz)"
        [sensor.pseudoranges]
        noise = "50 cm"
        elevation_noise = "50 cm"
        lever_arm = { initial = ["-0.4 m", "0 m", "-0.8 m"], sigma = "10 cm" }
        simulation = { rate = "1 Hz" }
        "#,
    )
}

#[test]
fn the_odometer_conforms() -> Result<(), Failed> {
    conforms(
        &navfuse_odometer::OdometerPlugin,
        r#"
        [sensor.odometer]
        noise = "5 cm/s"
        lateral_noise = "5 cm/s"
        vertical_noise = "10 cm/s"
        scale = { sigma = "1 %" }
        pitch = { sigma = "0.5 deg" }
        yaw = { sigma = "0.5 deg" }
        lever_arm = { initial = ["-1 m", "0.5 m", "0.5 m"], sigma = "10 cm" }
        simulation = { rate = "2 Hz" }
        "#,
    )
}

#[test]
fn the_speed_log_conforms() -> Result<(), Failed> {
    check(
        &[&navfuse_odometer::OdometerPlugin, &navfuse_doppler::DvlPlugin],
        &scenario(
            r#"
        [process.water]
        type = "water-current"
        current = { sigma = ["20 cm/s", "20 cm/s", "1 cm/s"] }
        [sensor.speed-log]
        noise = "5 cm/s"
        current = "water"
        lateral = true
        scale = { sigma = "1 %" }
        bias = { sigma = "2 cm/s" }
        yaw = { sigma = "0.5 deg" }
        lever_arm = { initial = ["-1 m", "0 m", "0.5 m"], sigma = "10 cm" }
        simulation = { rate = "2 Hz" }
        "#,
        ),
    )
}

#[test]
fn relative_poses_conform() -> Result<(), Failed> {
    conforms(
        &navfuse_relative_pose::RelativePosePlugin,
        r#"
        [sensor.relative-pose]
        translation_noise = "2 cm"
        rotation_noise = "0.1 deg"
        scale = { sigma = "1 %" }
        misalignment = { sigma = "0.5 deg" }
        lever_arm = { initial = ["1 m", "0.2 m", "-0.3 m"], sigma = "10 cm" }
        simulated_keyframes = "1 s"
        simulation = { rate = "2 Hz" }
        "#,
    )
}

#[test]
fn the_constraints_of_land_vehicles_conform() -> Result<(), Failed> {
    conforms(
        &navfuse_constraints::ConstraintsPlugin,
        r#"
        [sensor.non-holonomic]
        lateral_noise = "5 cm/s"
        vertical_noise = "10 cm/s"
        side_slip = { sigma = "0.5 deg", correlation_time = "2 s" }
        suspension = { sigma = "0.3 deg", correlation_time = "2 s" }
        pitch = { sigma = "0.5 deg" }
        yaw = { sigma = "0.5 deg" }
        lever_arm = { initial = ["-1 m", "0.5 m", "0.5 m"], sigma = "10 cm" }
        simulation = { rate = "2 Hz" }
        [sensor.zero-velocity]
        rotation_noise = "0.1 deg/s"
        simulation = { rate = "1 Hz" }
        "#,
    )
}

#[test]
fn the_heading_sensors_conform() -> Result<(), Failed> {
    conforms(
        &navfuse_heading::HeadingPlugin,
        r#"
        [sensor.magnetic-heading]
        noise = "0.5 deg"
        declination = { initial = "4 deg", sigma = "0.5 deg" }
        deviation = { sigma = "1 deg", correlation_time = "10 min" }
        simulation = { rate = "2 Hz" }
        [sensor.dual-antenna]
        noise = "0.2 deg"
        azimuth = { initial = "30 deg", sigma = "0.5 deg" }
        elevation = { sigma = "0.5 deg" }
        simulation = { rate = "1 Hz" }
        [sensor.magnetometer]
        noise = "0.2 uT"
        field = { strength = "46 uT", inclination = "60 deg", declination = { initial = "2 deg", sigma = "0.3 deg" } }
        hard_iron = { sigma = "2 uT" }
        scale = { sigma = "1 %" }
        soft_iron = { sigma = "1 %" }
        misalignment = { sigma = "0.5 deg" }
        simulation = { rate = "2 Hz" }
        [sensor.inclinometer]
        noise = "0.2 deg"
        roll_bias = { sigma = "0.5 deg" }
        pitch_bias = { sigma = "0.5 deg", correlation_time = "10 min" }
        simulation = { rate = "2 Hz" }
        "#,
    )
}

/// The vehicle dives from the surface to 15 m, past the first two of three layers.
#[test]
fn the_current_profiler_conforms() -> Result<(), Failed> {
    conforms(
        &navfuse_doppler::DvlPlugin,
        r#"
        [sensor.adcp]
        type = "water-profile"
        noise = "2 cm/s"
        layers = ["2 m", "12 m", "40 m"]
        current = { sigma = "20 cm/s", correlation_time = "1 h" }
        scale = { sigma = "0.5 %" }
        misalignment = { sigma = "0.5 deg" }
        lever_arm = ["0.3 m", "0 m", "0.2 m"]
        simulation = { rate = "0.5 Hz", cells = 8, first = "3 m", size = "4 m" }
        "#,
    )
}

#[test]
fn acoustic_positioning_conforms() -> Result<(), Failed> {
    conforms(
        &navfuse_acoustic::AcousticPlugin,
        r#"
        [process.water]
        type = "sound-speed"
        ratio = { sigma = "0.2 %", correlation_time = "1 h" }
        [sensor.usbl]
        range_noise = "20 cm"
        angle_noise = "0.2 deg"
        ship_noise = "30 cm"
        misalignment = { sigma = "0.5 deg" }
        transceiver = { initial = ["5 m", "1 m", "4 m"], sigma = "10 cm" }
        lever_arm = { initial = ["-0.4 m", "0 m", "-0.3 m"], sigma = "5 cm" }
        sound = "water"
        polar = true
        simulation = { rate = "1 Hz", latitude = "43.001 deg", speed = "1 m/s", heading = "30 deg", swell = "3 deg" }
        [sensor.beacon]
        type = "acoustic-range"
        noise = "30 cm"
        transponder = { latitude = "43.002 deg", longitude = "0.001 deg", height = "-60 m" }
        displacement = { sigma = "1 m" }
        lever_arm = { sigma = "5 cm" }
        sound = "water"
        simulation = { rate = "1 Hz", reach = "1 km" }
        [sensor.dock]
        type = "landmark"
        range_noise = "10 cm"
        angle_noise = "0.5 deg"
        place = { latitude = "43.001 deg", longitude = "0.0005 deg", height = "-20 m" }
        displacement = { sigma = "50 cm" }
        misalignment = { sigma = "0.5 deg" }
        lever_arm = { initial = ["1 m", "0 m", "0.2 m"], sigma = "2 cm" }
        polar = true
        simulation = { rate = "1 Hz" }
        "#,
    )?;
    conforms(
        &navfuse_acoustic::AcousticPlugin,
        r#"
        [process.ship]
        position = { sigma = "50 cm", correlation_time = "10 min" }
        attitude = { sigma = "0.1 deg", correlation_time = "30 min" }
        [sensor.ship-navigation]
        simulation = { rate = "5 Hz", latitude = "43.001 deg", speed = "1 m/s", turn = "1 deg/s", swell = "3 deg" }
        [sensor.usbl]
        ship = "ship"
        range_noise = "20 cm"
        angle_noise = "0.2 deg"
        simulation = { rate = "1 Hz" }
        "#,
    )
}

/// The shipped map lies around 43 deg N and 5 deg E.
#[test]
fn terrain_conforms() -> Result<(), Failed> {
    let map = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/survey-bottom.asc");
    let sensor = format!(
        r#"
        [sensor.terrain]
        map = {map:?}
        noise = "20 cm"
        map_noise = "20 cm"
        shift = {{ sigma = ["1 m", "1 m", "0.5 m"] }}
        lever_arm = {{ initial = ["0.4 m", "0 m", "0.3 m"], sigma = "5 cm" }}
        beam = [1, 0, 2]
        simulation = {{ rate = "2 Hz" }}
        "#
    );
    let scenario = scenario(&sensor).replace("heading =", "longitude = \"5 deg\", heading =");
    check(&[&navfuse_terrain::TerrainPlugin], &scenario)
}

#[test]
fn the_ahrs_and_its_dead_reckoning_conform_but_for_the_smooth_motion() {
    let failed = check(
        &[&navfuse_dead_reckoning::DeadReckoningPlugin, &navfuse_doppler::DvlPlugin],
        r#"
        [process.ins]
        type = "dead-reckoning"
        acceleration = "0.1 m/s^2/sqrt(Hz)"
        velocity = { sigma = "10 cm/s" }
        position = { sigma = "1 m" }

        [sensor.ahrs]
        noise = "0.1 deg"
        tilt = "0.3 deg"
        heading = "1 deg"
        declination = "4 deg"
        simulation = { rate = "10 Hz" }

        [sensor.dvl]
        noise = "1 cm/s"
        simulation = { rate = "4 Hz" }

        [sensor.reference]
        simulation = { rate = "1 Hz" }

        [source.simulation]
        start = { latitude = "43 deg", heading = "30 deg" }
        segments = [
            { type = "surge", duration = "20 s", speed = "0.5 m/s" },
            { type = "descend", duration = "30 s", rate = "0.2 m/s" },
            { type = "turn", duration = "20 s", angle = "90 deg", bank = "2 deg" },
            { type = "cruise", duration = "20 s" },
        ]
        "#,
    );
    let failed = failed.unwrap_err().to_string();
    let wrong: Vec<&str> = failed.lines().filter(|line| line.starts_with("WRONG")).collect();
    assert!(matches!(wrong[..], [nis] if nis.contains("innovations are smaller")), "{failed}");
}

#[test]
fn the_depth_sensor_conforms() -> Result<(), Failed> {
    conforms(
        &navfuse_depth::DepthPlugin,
        r#"
        [sensor.depth]
        noise = "5 cm"
        bias = { sigma = "20 cm", correlation_time = "10 min" }
        lever_arm = { initial = ["0.3 m", "0 m", "0.2 m"], sigma = "2 cm" }
        simulation = { rate = "2 Hz" }
        [sensor.pressure]
        noise = "5 mbar"
        atmosphere = { sigma = "20 mbar", correlation_time = "10 min" }
        density = { sigma = "0.2 %" }
        lever_arm = { initial = ["0.3 m", "0 m", "0.2 m"], sigma = "2 cm" }
        simulation = { rate = "2 Hz" }
        "#,
    )
}

#[test]
fn the_altimeter_of_the_tutorial_conforms() -> Result<(), Failed> {
    conforms(
        &first_plugin::AltimeterPlugin,
        r#"
        [sensor.altimeter]
        noise = "5 cm"
        bottom = { initial = "-80 m", sigma = "5 m" }
        lever_arm = ["0.5 m", "0 m", "0.2 m"]
        simulation = { rate = "2 Hz" }
        "#,
    )
}

#[test]
fn the_simulation_conforms() -> Result<(), Failed> {
    conforms(&navfuse_simulation::SimulationPlugin, "")
}

/// Checks a sink, and its source on the files that the sink wrote.
fn streams_conform(
    plugin: &dyn Plugin,
    sink: &str,
    source: impl Fn(&Path) -> String,
) -> Result<(), Failed> {
    check(&[plugin], &scenario(sink))?;
    let folder = tempfile::tempdir().unwrap();
    let mut registry = Registry::new();
    registry.add(&navfuse_ins::InsPlugin).add(&navfuse_simulation::SimulationPlugin).add(plugin);
    let document = Document::parse("scenario", scenario(sink)).unwrap();
    let assembly =
        Scenario::new(&registry, document, &[]).unwrap().assemble(Some(folder.path())).unwrap();
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let simulated = scenario("");
    let (filter, _) = simulated.split_once("[source.simulation]").unwrap();
    check(&[plugin], &format!("{filter}\n{}", source(folder.path())))
}

#[test]
fn logs_conform() -> Result<(), Failed> {
    let source = |folder: &Path| format!("[source.mcap]\npath = {:?}", folder.join("run.mcap"));
    streams_conform(&navfuse_mcap::McapPlugin, "[sink.mcap]", source)
}

#[test]
fn csv_conforms() -> Result<(), Failed> {
    check(&[&navfuse_csv::CsvPlugin], &scenario("[sink.csv]"))?;
    let folder = tempfile::tempdir().unwrap();
    let row = |k: i32| format!("{},0,0,0,0,0,-9.8\n", f64::from(k) * 0.1);
    let heading =
        "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n"
            .to_owned();
    std::fs::write(
        folder.path().join("imu.csv"),
        (1..=200).map(row).fold(heading, |all, row| all + &row),
    )
    .unwrap();
    let filter = r#"
        [process.ins]
        attitude = { sigma = "1 deg", initial = "0 deg" }
        velocity = { sigma = "1 cm/s", initial = "0 m/s" }
        position = { sigma = "1 m", latitude = "32 deg", longitude = "34 deg", height = "0 m" }
        [sensor.imu]
        gyro_noise = "0.1 deg/h/sqrt(Hz)"
        accel_noise = "10 ug/sqrt(Hz)"
    "#;
    check(
        &[&navfuse_csv::CsvPlugin],
        &format!("{filter}\n[source.csv]\ndirectory = {:?}", folder.path()),
    )
}
