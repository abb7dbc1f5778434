//! Blocks that come and go, outside of the framework: a walker who maps posts on a plane.

use navfuse_core::document::Document;
use navfuse_core::filter::{Ekf, Timeline};
use navfuse_core::model::record::{Outcome, Rejection};
use navfuse_core::nalgebra::{DMatrix, DVector};
use navfuse_core::prelude::*;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::covariance::Covariance;
use navfuse_testing::lab::{Log, seconds};

/// Sigma of the walker's place at the start and of a sight, m.
const START: f64 = 2.0;
const SIGHT: f64 = 0.1;
/// Density of the walker's random walk and of the posts', m^2/s.
const WALK: f64 = 0.04;

fn spec(initial: Vec<f64>, sigma: Vec<f64>, dynamics: Dynamics) -> BlockSpec {
    let display = Display { unit: "m", scale: 1.0, components: &["x", "y"] };
    BlockSpec { mode: Mode::Estimate, initial, sigma, truth: None, dynamics, display }
}

#[derive(Deserialize, JsonSchema)]
struct Walker {}

impl ProcessType for Walker {
    const TYPE: &'static str = "walker";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let walk = Dynamics::RandomWalk(vec![WALK; 2]);
        composer.block::<Vector<2>>("place", spec(vec![0.0; 2], vec![START; 2], walk))?;
        Ok(BuiltProcess::new(OwnDynamics))
    }
}

/// Sees posts, at most `posts` of which are states.
#[derive(Deserialize, JsonSchema)]
struct Sight {
    posts: usize,
    /// Prior sigma of a post, about where its first sample puts it; without it the sample places
    /// the post.
    sigma: Option<f64>,
    /// Density of a random walk of the posts, m^2/s.
    #[serde(default)]
    walk: f64,
}

struct Model {
    walker: Handle<Vector<2>>,
    posts: Transients<Vector<2>>,
    prior: bool,
}

impl SensorType for Sight {
    const TYPE: &'static str = "sight";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("x", "m"), Channel::new("y", "m"), Channel::new("post", "1")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let walker = composer.find("", "walker.place")?;
        let dynamics = match self.walk {
            0.0 => Dynamics::Constant,
            walk => Dynamics::RandomWalk(vec![walk; 2]),
        };
        let sigma = self.sigma.map_or(vec![], |sigma| vec![sigma; 2]);
        let posts = composer.transients("post", self.posts, spec(vec![0.0; 2], sigma, dynamics))?;
        Ok(Role::measurement(Model { walker, posts, prior: self.sigma.is_some() }))
    }
}

impl MeasurementModel<2> for Model {
    fn observations(&self) -> usize {
        8
    }
    /// A negative number removes its post.
    fn admit(&self, x: &View<'_, f64>, roster: &mut Roster<'_>) {
        let [Some(dx), Some(dy), Some(number)] = [0, 1, 2].map(|k| x.channel(k)) else { return };
        if number < 0.0 {
            roster.remove(self.posts, -number as u32);
            return;
        }
        let place = x.get(self.walker) + SVector::from([dx, dy]);
        if self.prior {
            roster.add(self.posts, number as u32, &place);
        } else {
            // the filter refines a rough value
            roster.place(self.posts, number as u32, &(place * 1.5));
        }
    }
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let number = x.channel(2).unwrap_or(0.0) as u32;
        match x.transient(self.posts, number) {
            Some(post) => post - x.get(self.walker),
            None => SVector::repeat(convert(f64::NAN)),
        }
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::identity() * (SIGHT * SIGHT)
    }
}

fn filter(keys: &str) -> Ekf {
    let mut registry = Registry::new();
    registry.process::<Walker>();
    registry.sensor::<Sight>();
    let text = format!("[process.walker]\n[sensor.sight]\ngate = \"off\"\n{keys}");
    let document = Document::parse("walk.toml", text).unwrap();
    Ekf::new(Scenario::new(&registry, document, &[]).unwrap().compose().unwrap())
}

fn see(ekf: &mut Ekf, time: f64, [x, y, post]: [f64; 3]) -> Log {
    let mut log = Log::default();
    ekf.process(&Sample::new(seconds(time), SensorId(0), &[x, y, post]), &mut log).unwrap();
    log
}

/// Sights of the first ten seconds: two posts in turn.
fn sights() -> impl Iterator<Item = (f64, [f64; 3])> {
    (0..10).map(f64::from).map(|t| {
        let post = if t < 3.0 { 1.0 } else { 1.0 + t % 2.0 };
        (t, [5.0 * post + 0.1 * (7.0 * t).sin(), -2.0 * post + 0.1 * (5.0 * t).cos(), post])
    })
}

fn covariance(ekf: &Ekf) -> DMatrix<f64> {
    ekf.covariance().to_dense()
}

/// The dense filter with a prior of 1e4 m: its information is 1e-8 per m^2 against 100 of a sight,
/// so both agree to about 1e-8 of the variances, and to 1e-6 with rounding of numbers of 1e8.
#[test]
fn a_block_that_a_sample_places_is_that_of_a_prior_without_information() {
    let mut ekf = filter("posts = 2");
    let (mut x, mut p) = (DVector::zeros(6), DMatrix::zeros(6, 6));
    for k in 0..6 {
        p[(k, k)] = if k < 2 { START * START } else { 1e8 };
    }
    for (t, sight) in sights() {
        see(&mut ekf, t, sight);
        if t > 0.0 {
            (0..2).for_each(|k| p[(k, k)] += WALK);
        }
        let post = 2 * sight[2] as usize;
        let h = DMatrix::from_fn(2, 6, |i, j| {
            f64::from(u8::from(j == post + i)) - f64::from(u8::from(j == i))
        });
        let s = &h * &p * h.transpose() + DMatrix::identity(2, 2) * (SIGHT * SIGHT);
        let gain = &p * h.transpose() * s.try_inverse().unwrap();
        let innovation = DVector::from_column_slice(&sight[..2]) - &h * &x;
        x += &gain * innovation;
        let kept = DMatrix::identity(6, 6) - &gain * h;
        p = &kept * &p * kept.transpose() + &gain * gain.transpose() * (SIGHT * SIGHT);
    }
    let found = covariance(&ekf);
    let values = &ekf.state().values;
    for i in 0..6 {
        let sigma = p[(i, i)].sqrt();
        assert!((values[i] - x[i]).abs() < 1e-6 * sigma, "{i}: {} {}", values[i], x[i]);
        for j in 0..6 {
            let scale = sigma * p[(j, j)].sqrt();
            assert!((found[(i, j)] - p[(i, j)]).abs() < 1e-6 * scale, "{i} {j} {found} {p}");
        }
    }
}

/// `Pyy = Pxx + R` and `Pyx = Pxx` of a post that stands at the walker plus the sight.
#[test]
fn a_placed_block_has_the_covariance_of_the_inverse_model_and_corrects_nothing() {
    let mut ekf = filter("posts = 2");
    let log = see(&mut ekf, 0.0, [3.0, 4.0, 7.0]);
    assert_eq!(log.outcomes(), [Outcome::Placed]);
    assert_eq!(log.says("sight post 7 added: sight.post_1"), 1, "{:?}", log.events);
    let p = covariance(&ekf);
    let prior = START * START;
    for i in 0..2 {
        assert!((p[(i, i)] - prior).abs() < 1e-12 && (p[(i, 2 + i)] - prior).abs() < 1e-12, "{p}");
        assert!((p[(2 + i, 2 + i)] - prior - SIGHT * SIGHT).abs() < 1e-12, "{p}");
    }
    let values = &ekf.state().values;
    assert_eq!(values[..2], [0.0, 0.0]);
    assert!((values[2] - 3.0).abs() < 1e-12 && (values[3] - 4.0).abs() < 1e-12, "{values:?}");
    // the second post is absent: no value, no covariance
    assert!(values[4..].iter().all(|v| v.is_nan()) && p.view((4, 0), (2, 6)).amax() == 0.0);
}

#[test]
fn a_marginalised_block_leaves_the_others_as_they_are_and_its_place_to_another() {
    let mut ekf = filter("posts = 2");
    sights().for_each(|(t, sight)| drop(see(&mut ekf, t, sight)));
    let (before, values) = (covariance(&ekf), ekf.state().values.clone());
    let log = see(&mut ekf, 9.0, [0.0, 0.0, -1.0]);
    assert_eq!(log.says("sight post 1 removed: sight.post_1"), 1, "{:?}", log.events);
    let after = covariance(&ekf);
    for i in 0..6 {
        for j in 0..6 {
            let gone = [i, j].iter().any(|k| (2..4).contains(k));
            assert_eq!(after[(i, j)], if gone { 0.0 } else { before[(i, j)] }, "{i} {j}");
        }
    }
    assert_eq!(ekf.state().values[4..], values[4..]);
    assert_eq!(ekf.state().values[..2], values[..2]);
    let log = see(&mut ekf, 9.0, [1.0, 1.0, 12.0]);
    assert_eq!(log.says("sight post 12 added: sight.post_1"), 1, "{:?}", log.events);
    assert_eq!(ekf.state().labels, [Some(12), Some(2)]);
}

#[test]
fn a_sample_of_an_absent_block_is_rejected_and_starts_no_lockout() {
    let mut ekf = filter("posts = 1\nrecovery = { after = \"2 s\" }");
    see(&mut ekf, 0.0, [3.0, 4.0, 1.0]);
    let mut logs = Vec::new();
    for t in 1..30 {
        logs.push(see(&mut ekf, f64::from(t), [5.0, 5.0, 2.0]));
    }
    for log in &logs {
        assert_eq!(log.outcomes(), [Outcome::Rejected(Rejection::Absent)]);
    }
    // reported once in a row
    assert_eq!(
        logs.iter().map(|log| log.says("state that it observes is absent")).sum::<usize>(),
        1
    );
    assert_eq!(logs.iter().map(|log| log.events.len()).sum::<usize>(), 1);
    assert!((covariance(&ekf)[(0, 0)] - START * START - 29.0 * WALK).abs() < 1e-9);
}

/// A prior of 1 m, and noise of 10 cm: `1 / (1 + 100)` m^2 relative to the walker, who is then
/// uncertain by that too.
#[test]
fn a_block_with_a_prior_is_added_uncorrelated_and_corrected_by_the_same_sample() {
    let mut ekf = filter("posts = 1\nsigma = 1.0\nwalk = 0.25");
    // absent for a while, the random walk of its place does not grow
    see(&mut ekf, 0.0, [0.0, 0.0, -1.0]);
    let log = see(&mut ekf, 8.0, [3.0, 4.0, 5.0]);
    assert_eq!(log.outcomes(), [Outcome::Accepted]);
    let walker = START * START + 8.0 * WALK;
    let s = walker + 1.0 + SIGHT * SIGHT;
    let p = covariance(&ekf);
    assert!((p[(2, 2)] - (1.0 - 1.0 / s)).abs() < 1e-12, "{p}");
    assert!((p[(0, 0)] - (walker - walker * walker / s)).abs() < 1e-12, "{p}");
    assert!((p[(0, 2)] - walker / s).abs() < 1e-12, "{p}");
    // and once it is there, it walks
    see(&mut ekf, 10.0, [0.0, 0.0, -9.0]);
    assert!((covariance(&ekf)[(2, 2)] - p[(2, 2)] - 0.5).abs() < 1e-12);
}

#[test]
fn a_snapshot_holds_who_is_there() {
    let mut ekf = filter("posts = 2");
    let all: Vec<_> = sights().collect();
    all[..4].iter().for_each(|(t, sight)| drop(see(&mut ekf, *t, *sight)));
    let snapshot = ekf.snapshot();
    let mut ends = Vec::new();
    for _ in 0..2 {
        all[4..].iter().for_each(|(t, sight)| drop(see(&mut ekf, *t, *sight)));
        see(&mut ekf, 9.0, [0.0, 0.0, -1.0]);
        let bits = ekf.state().values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        ends.push((bits, covariance(&ekf), ekf.state().labels.clone()));
        ekf.restore(&snapshot);
        assert_eq!(ekf.state().labels, [Some(1), Some(2)]);
    }
    assert_eq!(ends[0], ends[1]);
}

/// Posts that are placed, seen and removed, with sights that arrive up to 3 s late: what comes and
/// goes is replayed in its own order, also in the newest estimate of a live run.
#[test]
fn late_sights_of_posts_that_come_and_go_give_the_run_in_order_to_the_bit() {
    let keys = "posts = 2\nlate = \"3 s\"";
    let mut all: Vec<(f64, [f64; 3])> = sights().collect();
    // post 1 goes after it was seen the last time, and another takes its place
    all.extend([(9.5, [0.0, 0.0, -1.0]), (10.0, [1.0, 2.0, 3.0]), (11.0, [1.1, 2.1, 3.0])]);
    let sample = |(t, s): &(f64, [f64; 3])| Sample::new(seconds(*t), SensorId(0), s);
    let bits = |state: &State, p: &Covariance| {
        let values: Vec<u64> = state.values.iter().map(|v| v.to_bits()).collect();
        (values, p.clone(), state.labels.clone())
    };
    let mut straight = filter(keys);
    let mut first = Log::default();
    all.iter().for_each(|s| straight.process(&sample(s), &mut first).unwrap());
    let end = bits(straight.state(), &straight.covariance());
    assert_eq!(end.2, [Some(3), Some(2)]);
    // each third sight arrives first, up to 2.5 s before its turn: the others are late
    let mut arrivals = all.clone();
    arrivals.chunks_mut(3).for_each(|three| three.rotate_right(1));
    let mut ekf = filter(keys);
    let mut timeline = Timeline::new(ekf.composition()).unwrap();
    let (mut log, mut newest) = (Log::default(), None);
    for arrival in &arrivals {
        assert!(timeline.arrive(&sample(arrival), &mut ekf, &mut log));
        while let Some(next) = timeline.release(ekf.running()) {
            ekf.process(&next, &mut log).unwrap();
        }
        newest = timeline.newest(&mut ekf, |epoch| bits(epoch.state, epoch.covariance));
    }
    assert_eq!(newest.as_ref(), Some(&end), "the newest estimate has taken all of them");
    assert_ne!(bits(ekf.state(), &ekf.covariance()), end, "the settled one waits");
    timeline.close();
    while let Some(next) = timeline.release(ekf.running()) {
        ekf.process(&next, &mut log).unwrap();
    }
    assert_eq!(bits(ekf.state(), &ekf.covariance()), end);
    assert_eq!((log.outcomes(), log.events.len()), (first.outcomes(), first.events.len()));
}
