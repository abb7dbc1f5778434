//! Checkpoints: a run goes on from one to the bit, and whatever does not fit is refused by name.

use navfuse_core::checkpoint::{Checkpoint, CheckpointError};
use navfuse_core::model::record::{Event, Level};
use navfuse_core::session::{End, Session};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_testing::lab::{SCENARIO, compose, seconds};
use proptest::prelude::*;

/// Ten seconds of the speed at 10 Hz, and of fixes at 2 Hz, which are wrong after 5 s.
fn samples() -> Vec<Sample> {
    let of = |k: i32| {
        let t = f64::from(k) * 0.1;
        let place = t + if k > 50 { 30.0 } else { 0.02 };
        let speed = Sample::new(seconds(t), SensorId(0), &[1.0]);
        let fix = Sample::new(seconds(t), SensorId(1), &[place, 2.0 * place, 0.1 * place * place]);
        [Some(speed), (k % 5 == 0).then_some(fix)]
    };
    (0..100).flat_map(of).flatten().collect()
}

fn session(settings: &[&str]) -> Session {
    Session::new(compose(SCENARIO, settings), Vec::new())
}

/// A session after the first samples.
fn halfway(settings: &[&str]) -> Session {
    let mut session = session(settings);
    samples()[..60].iter().for_each(|sample| session.push(sample).unwrap());
    session
}

fn resume(
    scenario: &str,
    settings: &[&str],
    from: &Checkpoint,
) -> Result<Session, CheckpointError> {
    Session::resume(compose(scenario, settings), Vec::new(), from)
}

/// Result, events and findings of a run.
fn ended(session: Session) -> (String, String) {
    let finished = session.finish(End::Complete);
    let summary = serde_json::to_string(&finished.summary).unwrap();
    (summary, format!("{:?} {:?}", finished.events, finished.findings))
}

#[test]
fn a_run_that_is_cut_at_every_sample_equals_the_uncut_one() {
    for settings in
        [&[][..], &["estimator.covariance_rate=\"every sample\""], &["sensor.fix.late=\"2 s\""]]
    {
        let (mut uncut, mut cut) = (session(settings), session(settings));
        for sample in &samples() {
            let saved = cut.checkpoint().unwrap();
            cut = resume(SCENARIO, settings, &saved).unwrap();
            assert!(cut.checkpoint().unwrap() == saved);
            uncut.push(sample).unwrap();
            cut.push(sample).unwrap();
            assert_eq!(uncut.health(), cut.health());
        }
        let uncut = ended(uncut);
        assert!(uncut.1.contains("gated"), "the wrong fixes are an event: {}", uncut.1);
        assert_eq!(ended(cut), uncut, "{settings:?}");
    }
}

#[test]
fn an_announced_event_is_logged_once() {
    let mut session = session(&[]);
    let event = |t: f64, text: &str| Event {
        time: seconds(t),
        level: Level::Warning,
        about: "dive".to_owned(),
        text: text.to_owned(),
    };
    session.announce(vec![event(1.0, "early"), event(8.0, "late")]);
    samples()[..60].iter().for_each(|sample| session.push(sample).unwrap());
    let saved = session.checkpoint().unwrap();
    let mut resumed = resume(SCENARIO, &[], &saved).unwrap();
    samples()[60..].iter().for_each(|sample| resumed.push(sample).unwrap());
    let events = resumed.finish(End::Complete).events;
    let texts = events.iter().filter(|event| event.about == "dive").map(|event| &*event.text);
    assert_eq!(texts.collect::<Vec<_>>(), ["early", "late"]);
}

#[test]
fn another_layout_is_refused_by_name() {
    let saved = halfway(&[]).checkpoint().unwrap();
    let refused = |scenario: &str, settings: &[&str]| match resume(scenario, settings, &saved) {
        Ok(_) => panic!("it was resumed"),
        Err(error) => error.to_string(),
    };
    let more = format!("{SCENARIO}\n[sensor.survey]\n");
    let other = SCENARIO.replace("[sensor.fix]", "[sensor.gps]\ntype = \"fix\"");
    let of = "the checkpoint is of another scenario";
    assert_eq!(
        refused(&more, &[]),
        format!("{of}: it does not have the sensor survey of this scenario")
    );
    assert_eq!(
        refused(&other, &[]),
        format!("{of}: it has the sensor fix, which this scenario does not have")
    );
    assert_eq!(
        refused(SCENARIO, &["process.cart.drift.mode=\"fixed\""]),
        format!(
            "{of}: its state cart.drift has mode estimate and 1 axes, where this scenario has mode \
             fixed and 1 axes"
        )
    );
    assert_eq!(
        refused(SCENARIO, &["estimator.type=\"ukf\""]),
        format!("{of}: it has the estimator ekf, which this scenario does not have")
    );
    assert_eq!(
        refused(SCENARIO, &["sensor.fix.late=\"2 s\""]),
        "the checkpoint does not fit the scenario: late samples: 0 values, where the scenario has 1"
    );
}

/// Settings that change no part, such as a gate, are those of the new scenario.
#[test]
fn another_setting_of_the_same_parts_is_resumed() {
    let saved = halfway(&[]).checkpoint().unwrap();
    assert!(resume(SCENARIO, &["sensor.fix.noise=\"20 cm\""], &saved).is_ok());
}

#[test]
fn bytes_of_something_else_or_of_another_version_are_refused() {
    let bytes = halfway(&[]).checkpoint().unwrap().as_bytes().to_vec();
    let error = |bytes: &[u8]| Checkpoint::from_bytes(bytes).unwrap_err();
    assert!(Checkpoint::from_bytes(&bytes).is_ok());
    assert_eq!(error(b""), CheckpointError::Foreign);
    assert_eq!(error(b"time_s,vel_x_mps\n0.0,1.0\n"), CheckpointError::Foreign);
    let mut newer = bytes.clone();
    newer[8] += 1;
    let found = u32::from(newer[8]);
    assert_eq!(error(&newer), CheckpointError::Version { found, read: found - 1 });
    let length = bytes.len() as u64;
    let cut = &bytes[..bytes.len() - 1];
    assert_eq!(error(cut), CheckpointError::Truncated { found: length - 1, length });
    let longer = [&bytes[..], b"\n"].concat();
    assert_eq!(error(&longer), CheckpointError::Damaged);
}

#[test]
fn every_missing_end_and_every_changed_byte_is_noticed() {
    let bytes = halfway(&[]).checkpoint().unwrap().as_bytes().to_vec();
    let refused = |bytes: &[u8]| Checkpoint::from_bytes(bytes).is_err();
    assert!((0..bytes.len()).step_by(7).all(|length| refused(&bytes[..length])));
    for at in (0..bytes.len()).step_by(7) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        assert!(refused(&damaged), "byte {at}");
    }
}

#[test]
fn a_smoothed_run_is_not_saved() {
    let refused = halfway(&["estimator.smooth=true"]).checkpoint().unwrap_err().to_string();
    assert!(refused.starts_with("the run cannot be saved: the smoother"), "{refused}");
}

/// The checkpoint with other bytes from a place on, and the checksum of these.
fn forged(mut bytes: Vec<u8>, at: usize, with: &[u8]) -> Vec<u8> {
    let end = bytes.len() - 8;
    let place = 20 + at % (end - 20);
    bytes[place..end].iter_mut().zip(with).for_each(|(byte, with)| *byte = *with);
    let sum = bytes[..end].iter().fold(0xcbf2_9ce4_8422_2325_u64, |sum, byte| {
        (sum ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    });
    bytes[end..].copy_from_slice(&sum.to_le_bytes());
    bytes
}

proptest! {
    #[test]
    fn random_bytes_are_no_checkpoint(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Checkpoint::from_bytes(&bytes).is_err());
        let marked = [b"NAVFUSE\x01\x01\0\0\0", &bytes[..]].concat();
        prop_assert!(Checkpoint::from_bytes(&marked).is_err());
    }

    /// Whatever the memory holds, it is restored or refused, without a panic, and takes no more
    /// room than its bytes.
    #[test]
    fn a_memory_that_was_changed_together_with_its_checksum_is_read_without_a_panic(
        at in any::<usize>(),
        with in prop::collection::vec(prop_oneof![Just(0_u8), Just(255), any::<u8>()], 1..24),
    ) {
        let bytes = halfway(&[]).checkpoint().unwrap().as_bytes().to_vec();
        let checkpoint = Checkpoint::from_bytes(&forged(bytes, at, &with)).unwrap();
        resume(SCENARIO, &[], &checkpoint).ok();
    }
}
