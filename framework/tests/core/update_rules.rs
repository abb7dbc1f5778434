//! Update rules on models that are curved within the uncertainty, written as an outsider writes
//! them: ranges to a beacon, a product of two unknowns, directions seen from a turned body.

use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::record::finding::{Finding, Severity};
use navfuse_core::model::record::{Outcome, Rejection};
use navfuse_core::model::sensor::rule::{Prior, Rule, RuleType};
use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::{DMatrix, DVector, Rotation3, SMatrix, SVector, Vector2, Vector3};
use navfuse_core::prelude::*;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::run::schema::scenario_schema;
use navfuse_core::state::covariance::Update;
use navfuse_testing::lab::{self, Log, SCENARIO, seconds};

const RULES: [&str; 3] = ["ekf", "iekf", "ukf"];

/// Unknown constants: a beacon on the sea floor, two factors and an attitude.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Unknowns {
    /// Prior sigma of the beacon, m.
    beacon: f64,
    /// Prior sigma of each factor.
    factors: [f64; 2],
    /// Prior sigma of the attitude, rad.
    attitude: f64,
    /// Set to hold the second factor as a considered state.
    #[serde(default)]
    consider: bool,
}

impl ProcessType for Unknowns {
    const TYPE: &'static str = "unknowns";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let spec = |initial: Vec<f64>, sigma: f64, display: Display| BlockSpec {
            mode: Mode::Estimate,
            sigma: vec![sigma; initial.len()],
            initial,
            truth: None,
            dynamics: Dynamics::Constant,
            display,
        };
        composer.block::<Vector<2>>("beacon", spec(vec![0.0; 2], self.beacon, display::LENGTH))?;
        composer.block::<Scalar>("a", spec(vec![2.0], self.factors[0], display::RATIO))?;
        let mode = if self.consider { Mode::Consider } else { Mode::Estimate };
        let b = BlockSpec { mode, ..spec(vec![10.0], self.factors[1], display::RATIO) };
        composer.block::<Scalar>("b", b)?;
        let attitude = spec(vec![0.0; 3], self.attitude, display::ANGLES);
        composer.block::<Rotation>("attitude", attitude)?;
        Ok(BuiltProcess::new(OwnDynamics))
    }
}

/// Defines a sensor type from its channels, the number of those measured, its states and its `h`.
macro_rules! sensor {
    ($sensor:ident, $model:ident, $name:literal, $channels:expr, $n:literal,
     { $($state:ident: $manifold:ty = $full:literal),* }, |$x:ident, $m:ident| $h:expr) => {
        #[derive(Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        struct $sensor {
            noise: f64,
        }
        impl SensorType for $sensor {
            const TYPE: &'static str = $name;
            fn channels(&self) -> Vec<Channel> {
                $channels.map(|(name, unit)| Channel::new(name, unit)).to_vec()
            }
            fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
                $(let $state = composer.find("states", $full)?;)*
                Ok(Role::measurement($model { $($state,)* noise: self.noise }))
            }
        }
        struct $model {
            $($state: Handle<$manifold>,)*
            noise: f64,
        }
        impl MeasurementModel<$n> for $model {
            fn predict<T: Real>(&self, $x: &View<'_, T>) -> SVector<T, $n> {
                let $m = self;
                $h
            }
            fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, $n, $n> {
                SMatrix::identity() * (self.noise * self.noise)
            }
        }
    };
}

sensor!(Ranges, RangeModel, "ranges", [("range", "m"), ("ship_x", "m"), ("ship_y", "m")], 1,
{ beacon: Vector<2> = "unknowns.beacon" }, |x, m| {
    let ship = Vector2::new(x.channel(1), x.channel(2)).map(|v| convert(v.unwrap_or(f64::NAN)));
    SVector::from([(x.get(m.beacon) - ship).norm()])
});
sensor!(Product, ProductModel, "product", [("product", "1")], 1,
    { a: Scalar = "unknowns.a", b: Scalar = "unknowns.b" },
    |x, m| SVector::from([x.get(m.a) * x.get(m.b)]));
sensor!(Square, SquareModel, "square", [("square", "1")], 1,
    { a: Scalar = "unknowns.a" },
    |x, m| SVector::from([x.get(m.a) * x.get(m.a)]));
sensor!(Root, RootModel, "root", [("root", "1")], 1,
    { a: Scalar = "unknowns.a" },
    |x, m| SVector::from([(x.get(m.a) - convert::<f64, T>(1.0)).sqrt()]));
sensor!(Sum, SumModel, "sum", [("sum", "1"), ("difference", "1")], 2,
    { a: Scalar = "unknowns.a", b: Scalar = "unknowns.b" },
    |x, m| SVector::from([x.get(m.a) + x.get(m.b), x.get(m.a) - x.get(m.b)]));
sensor!(Form, FormModel, "form", [("form", "1")], 1,
{ beacon: Vector<2> = "unknowns.beacon", a: Scalar = "unknowns.a" }, |x, m| {
    let [p, q] = x.get(m.beacon).into();
    SVector::from([p * p + q * q + q * x.get(m.a)])
});
sensor!(Directions, DirectionModel, "directions",
[("n_x", "1"), ("n_y", "1"), ("n_z", "1"), ("d_x", "1"), ("d_y", "1"), ("d_z", "1")], 6,
{ attitude: Rotation = "unknowns.attitude" }, |x, m| {
    let back = x.get(m.attitude).inverse();
    let (n, d) = (back * Vector3::<f64>::x().map(convert), back * Vector3::<f64>::z().map(convert));
    SVector::from([n.x, n.y, n.z, d.x, d.y, d.z])
});

struct Mine;

impl Plugin for Mine {
    fn build(&self, registry: &mut Registry) {
        registry.process::<Unknowns>();
        registry.sensor::<Ranges>();
        registry.sensor::<Product>();
        registry.sensor::<Square>();
        registry.sensor::<Root>();
        registry.sensor::<Sum>();
        registry.sensor::<Form>();
        registry.sensor::<Directions>();
        registry.rule::<Wary>();
    }
}

/// An outsider's rule: the noise grows with the prior variance of the states that a sensor reads.
#[derive(Default)]
struct Wary;

impl Rule for Wary {
    fn linearised(&mut self, prior: &Prior<'_>, update: &mut Update) {
        let spread: f64 = update.columns.iter().map(|&c| prior.covariance.get(c, c)).sum();
        update.r.iter_mut().for_each(|r| *r *= 1.0 + spread);
    }
}

impl RuleType for Wary {
    const TYPE: &'static str = "wary";
}

const UNKNOWNS: &str = r#"
[process.unknowns]
beacon = 10
factors = [0.5, 3]
attitude = 1
[sensor.ranges]
noise = 0.1
gate = "off"
[sensor.product]
noise = 0.01
gate = "off"
[sensor.square]
noise = 0.1
gate = "off"
[sensor.root]
noise = 1e-9
gate = "off"
[sensor.sum]
noise = 0.1
gate = "off"
[sensor.form]
noise = 0.01
gate = "off"
[sensor.directions]
noise = 0.001
gate = "off"
"#;

/// A filter with its log.
struct Bench {
    ekf: Ekf,
    log: Log,
    time: f64,
}

impl Bench {
    fn new(rule: &str, settings: &[&str]) -> Self {
        let mut registry = Registry::new();
        registry.add(&Mine);
        let mut all = vec![format!("estimator.update={rule}")];
        all.extend(settings.iter().map(|s| (*s).to_owned()));
        let document = Document::parse("unknowns.toml", UNKNOWNS).unwrap();
        let scenario = Scenario::new(&registry, document, &all).unwrap();
        Self { ekf: Ekf::new(scenario.compose().unwrap()), log: Log::default(), time: 0.0 }
    }

    fn give(&mut self, sensor: &str, values: &[f64]) {
        let id = SensorId(self.ekf.composition().sensor(sensor).unwrap());
        self.ekf.process(&Sample::new(seconds(self.time), id, values), &mut self.log).unwrap();
        self.time += 1.0;
    }

    fn values(&self, block: &str) -> &[f64] {
        let block = self.ekf.layout().find(block).unwrap();
        &self.ekf.state().values[block.range()]
    }

    fn covariance(&self, block: &str) -> DMatrix<f64> {
        let range = self.ekf.layout().find(block).unwrap().tangent_range();
        let (n, first) = (range.len(), range.start);
        DMatrix::from_fn(n, n, |i, j| self.ekf.covariance().get(first + i, first + j))
    }

    /// Normalised squared error of a block.
    fn nees(&self, block: &str, truth: &[f64]) -> f64 {
        let e = DVector::from_row_slice(truth) - DVector::from_row_slice(self.values(block));
        e.dot(&self.covariance(block).cholesky().unwrap().solve(&e))
    }
}

#[test]
fn on_a_linear_model_the_rules_agree() {
    for settings in [&[][..], &["process.unknowns.consider=true"]] {
        let mut ends = RULES.map(|rule| {
            let mut b = Bench::new(rule, settings);
            for k in 0..5 {
                b.give("sum", &[12.3 + 0.1 * f64::from(k), -7.9]);
            }
            let blocks = ["unknowns.a", "unknowns.b"];
            blocks.map(|block| [b.values(block)[0], b.covariance(block)[(0, 0)]]).concat()
        });
        let (first, others) = ends.split_first_mut().unwrap();
        for other in others {
            let apart = first.iter().zip(other.iter()).map(|(a, b)| (a - b).abs());
            // rounding of numbers of about ten
            assert!(apart.fold(0.0, f64::max) < 1e-12, "{first:?} {other:?}");
        }
        if !settings.is_empty() {
            assert_eq!(first[2..], [10.0, 9.0], "a considered state stays");
        }
    }
}

/// The square of `a` has the slope 4 at `a = 2` and the noise 0.1, whose variance grows by `1 + P`.
#[test]
fn a_plugins_rule_corrects_by_its_own_linearisation() {
    let mut b = Bench::new("wary", &[]);
    b.give("square", &[6.0]);
    let p = 0.25;
    let s = 16.0 * p + 0.01 * (1.0 + p);
    assert!((b.log.updates[0].2 - 4.0 / s).abs() < 1e-12, "{:?}", b.log.updates[0]);
    assert!((b.values("unknowns.a")[0] - 2.0 - 4.0 * p * 2.0 / s).abs() < 1e-12);
    assert!((b.covariance("unknowns.a")[(0, 0)] - (p - 16.0 * p * p / s)).abs() < 1e-12);
    // the other sensors keep their own
    let mut b = Bench::new("wary", &["sensor.square.update=\"ekf\""]);
    b.give("square", &[6.0]);
    assert!((b.log.updates[0].2 - 4.0 / (16.0 * p + 0.01)).abs() < 1e-12);
}

#[test]
fn an_unknown_rule_is_rejected_with_the_registered_names() {
    let mut registry = Registry::new();
    registry.add(&Mine);
    let refused = |setting: &str| {
        let document = Document::parse("unknowns.toml", UNKNOWNS).unwrap();
        let scenario = Scenario::new(&registry, document, &[setting.to_owned()]).unwrap();
        scenario.compose().err().unwrap().to_string()
    };
    for key in ["estimator.update", "sensor.square.update"] {
        let message = refused(&format!("{key}=\"wery\""));
        assert!(message.contains(key) && message.contains("did you mean \"wary\"?"), "{message}");
        assert!(message.contains("ekf, iekf, ukf, wary"), "{message}");
    }
    let schema = scenario_schema(&registry);
    for place in ["/properties/estimator", "/$defs/sensor.square"] {
        let rules = schema.pointer(&format!("{place}/properties/update/enum"));
        assert_eq!(rules, Some(&serde_json::json!(["ekf", "iekf", "ukf", "wary"])), "{place}");
    }
    registry.rule::<Wary>();
    let clash = registry.check().unwrap_err().to_string();
    assert!(clash.contains("update rule") && clash.contains("wary"), "{clash}");
}

/// The minimum of `(a - 2)^2 / 0.5^2 + (z - a^2)^2 / 0.1^2`, by Newton's method.
#[test]
fn the_iterated_update_ends_at_the_most_probable_state() {
    for z in [6.0, 2.0, 9.0] {
        let mut b = Bench::new("iekf", &[]);
        b.give("square", &[z]);
        let slope = |a: f64| (a - 2.0) / 0.25 - 2.0 * a * (z - a * a) / 0.01;
        let mut a = z.sqrt();
        for _ in 0..50 {
            let curvature = 4.0 - 2.0 * (z - 3.0 * a * a) / 0.01;
            a -= slope(a) / curvature;
        }
        let given = b.values("unknowns.a")[0];
        // the iteration ends at a step of a thousandth of the prior sigma, which Gauss-Newton
        // squares
        assert!((given - a).abs() < 1e-5, "{z}: {given} {a}");
    }
}

/// For a Gaussian `a` the mean of `a^2` is `2^2 + P`, its variance `4 2^2 P + 2 P^2`; a product of
/// two independent factors has the variance `2^2 Pb + 10^2 Pa + Pa Pb`.
#[test]
fn the_unscented_update_has_the_moments_of_a_square_and_of_a_product() {
    let mut b = Bench::new("ukf", &[]);
    b.give("square", &[6.0]);
    let p = 0.25;
    let (mean, variance) = (4.0 + p, 16.0 * p + 2.0 * p * p + 0.01);
    let (innovation, nis) = (b.log.innovation[0], b.log.updates[0].2);
    assert!((innovation - (6.0 - mean)).abs() < 1e-12, "{innovation}");
    assert!((innovation * innovation / nis / variance - 1.0).abs() < 1e-12, "{nis}");
    let mut b = Bench::new("ukf", &[]);
    b.give("product", &[26.0]);
    let variance = 4.0 * 9.0 + 100.0 * p + 9.0 * p + 1e-4;
    let (innovation, nis) = (b.log.innovation[0], b.log.updates[0].2);
    assert!((innovation - 6.0).abs() < 1e-12, "{innovation}");
    assert!((innovation * innovation / nis / variance - 1.0).abs() < 1e-12, "{nis}");
}

/// A quadratic form of Gaussian numbers with the slopes `g`, the second derivatives `Q` and the
/// variances `P` has the variance `sum g_i^2 P_i + 1/2 sum Q_ij^2 P_i P_j`. For `p^2 + q^2 + q a` at
/// zero and `a = 2` the slope along `q` is 2, and `Q` has 2 for `pp` and `qq` and 1 for `qa`.
#[test]
fn the_unscented_update_has_the_variance_of_a_quadratic_form_of_three_unknowns() {
    let mut b = Bench::new("ukf", &[]);
    b.give("form", &[210.0]);
    let (p, q, a) = (100.0, 100.0, 0.25);
    let variance = 4.0 * q + 0.5 * (4.0 * p * p + 4.0 * q * q + 2.0 * q * a) + 1e-4;
    let (innovation, nis) = (b.log.innovation[0], b.log.updates[0].2);
    assert!((innovation - (210.0 - p - q)).abs() < 1e-9, "{innovation}");
    assert!((innovation * innovation / nis / variance - 1.0).abs() < 1e-12, "{nis}");
}

/// Directions of north and down, seen from a body that is turned by 70 deg and measured to 1 mrad:
/// one update gives the attitude to about a milliradian if it is iterated on the manifold.
#[test]
fn an_iterated_update_turns_an_attitude_by_any_angle() {
    let axis = Vector3::new(1.0, -2.0, 0.5).normalize();
    let truth = Rotation3::from_scaled_axis(axis * 70_f64.to_radians());
    let (n, d) = (truth.inverse() * Vector3::x(), truth.inverse() * Vector3::z());
    let error = |rule: &str| {
        let mut b = Bench::new(rule, &[]);
        b.give("directions", &[n.x, n.y, n.z, d.x, d.y, d.z]);
        let q = b.values("unknowns.attitude");
        let q = navfuse_core::state::manifold::load_quaternion(q);
        (q.to_rotation_matrix() * truth.inverse()).angle()
    };
    // the prior of 1 rad pulls by 1e-6 of 70 deg
    assert!(error("iekf") < 1e-5, "{}", error("iekf"));
    assert!(error("ekf") > 0.1, "{}", error("ekf"));
}

/// A ship passes a beacon whose place is known to 10 m, and measures ranges to 0.1 m.
fn pass_a_beacon(rule: &str, seed: u64) -> (f64, Vec<Finding>) {
    let mut b = Bench::new(rule, &[]);
    let mut random = Random::new(seed, "beacon");
    let beacon = Vector2::new(10.0 * random.normal(), 10.0 * random.normal());
    for k in 0..40 {
        let ship = Vector2::new(-60.0 + 3.0 * f64::from(k), 40.0);
        let range = (beacon - ship).norm() + 0.1 * random.normal();
        b.give("ranges", &[range, ship.x, ship.y]);
    }
    (b.nees("unknowns.beacon", beacon.as_slice()), b.log.findings)
}

/// A factor known to 0.5 and one to 3, whose product is measured to 0.1, and the first factor later.
fn find_the_factors(rule: &str, seed: u64) -> f64 {
    let mut b = Bench::new(rule, &["sensor.product.noise=0.1"]);
    let mut random = Random::new(seed, "factors");
    let (a, c) = (2.0 + 0.5 * random.normal(), 10.0 + 3.0 * random.normal());
    b.give("product", &[a * c + 0.1 * random.normal()]);
    for _ in 0..5 {
        b.give("square", &[a * a + 0.1 * random.normal()]);
    }
    b.nees("unknowns.b", &[c])
}

/// Mean normalised squared error of that number of runs.
fn mean(runs: u32, nees: impl Fn(u64) -> f64) -> f64 {
    (1..=u64::from(runs)).map(nees).sum::<f64>() / f64::from(runs)
}

#[test]
fn ranges_to_a_beacon_with_a_wide_prior_are_consistent_under_the_unscented_update() {
    let [ekf, iekf, ukf] = RULES.map(|rule| mean(30, |seed| pass_a_beacon(rule, seed).0));
    println!("mean NEES of two coordinates: ekf {ekf:.2}, iekf {iekf:.2}, ukf {ukf:.2}");
    // chi-square of 60 degrees of freedom: 31.7 to 99.6 with 99.8 %, over 30 runs
    assert!((1.06..3.32).contains(&ukf), "{ukf}");
    assert!(ekf > 3.32 && iekf > 3.32, "{ekf} {iekf}");
    let findings = |rule: &str| pass_a_beacon(rule, 1).1;
    for rule in ["ekf", "iekf"] {
        let found = findings(rule);
        let [Finding { about, severity, text, remedy, .. }] = &found[..] else {
            panic!("{rule}: {found:?}")
        };
        assert_eq!(about, "ranges", "{rule}: {text}");
        assert!(rule == "iekf" || *severity == Severity::DoNotUse, "{rule}: {text}");
        assert!(text.contains("unknowns.beacon") && text.contains("range is"), "{rule}: {text}");
        assert!(remedy.contains("[sensor.ranges] update = \"ukf\""), "{rule}: {remedy}");
    }
    assert!(findings("ukf").is_empty(), "{:?}", findings("ukf"));
}

#[test]
fn a_product_of_unknowns_is_consistent_under_the_unscented_update() {
    let [ekf, iekf] = ["ekf", "iekf"].map(|rule| mean(50, |seed| find_the_factors(rule, seed)));
    let ukf = mean(500, |seed| find_the_factors("ukf", seed));
    println!("mean NEES of a factor: ekf {ekf:.2}, iekf {iekf:.2}, ukf {ukf:.2}");
    // errors of a factor have wider tails than a Gaussian: the mean of 500 squares of them scatters
    // by 0.16, and three times that is the band
    assert!((0.52..1.48).contains(&ukf), "{ukf}");
    // chi-square of 50 degrees of freedom: 90 with 99.95 %, over 50 runs
    assert!(ekf > 1.8 && iekf > 1.8, "{ekf} {iekf}");
}

#[test]
fn a_sensor_has_its_own_rule_and_a_gate_under_each() {
    let mut b = Bench::new("ekf", &["sensor.square.update=ukf", "sensor.square.gate=0.9999"]);
    b.give("square", &[4.25]);
    assert!(b.log.innovation[0].abs() < 1e-12, "the mean of a square is above the square");
    for rule in RULES {
        let mut b = Bench::new(rule, &["sensor.square.gate=0.9999"]);
        b.give("square", &[40.0]);
        assert_eq!(b.values("unknowns.a"), [2.0], "{rule}: gated");
        b.give("square", &[6.0]);
        assert!(b.values("unknowns.a")[0] > 2.2, "{rule}: used");
    }
}

/// A weight of `5 / e^2` makes the noise of a sample `1e154` sigma off infinite. The iteration of
/// `sqrt(a - 1) = 0` from `a = 2` steps to 0, where there is no root, and half as far to 1, where
/// the slope is infinite.
#[test]
fn a_sample_whose_refined_update_is_singular_is_recorded_once_as_rejected() {
    let cases = [
        (
            "square",
            1e157,
            "ekf",
            &["sensor.square.robust=student-t", "sensor.square.noise=1e3"][..],
        ),
        ("root", 0.0, "iekf", &[]),
    ];
    for (sensor, value, rule, settings) in cases {
        let mut b = Bench::new(rule, settings);
        b.give(sensor, &[value]);
        assert_eq!(b.log.outcomes(), [Outcome::Rejected(Rejection::Singular)], "{sensor}");
        assert_eq!(b.values("unknowns.a"), [2.0], "{sensor}");
        assert_eq!(b.covariance("unknowns.a")[(0, 0)], 0.25, "{sensor}: the prior");
    }
}

/// The gate judges the linear update, and the record holds what it judged.
#[test]
fn the_record_of_a_refined_update_holds_the_innovation_of_the_gate() {
    for (rule, robust) in [("ekf", "off"), ("ekf", "huber"), ("iekf", "off"), ("iekf", "huber")] {
        let mut b = Bench::new(rule, &[&format!("sensor.square.robust={robust}")]);
        b.give("square", &[10.0]);
        // S = 4^2 / 4 + 0.01
        let (innovation, nis) = (b.log.innovation[0], b.log.updates[0].2);
        assert_eq!(innovation, 6.0, "{rule} {robust}");
        assert!((nis - 36.0 / 4.01).abs() < 1e-9, "{rule} {robust}: {nis}");
        assert_eq!(b.log.outcomes(), [Outcome::Accepted], "{rule} {robust}");
    }
}

#[test]
fn a_past_state_is_updated_by_the_ekf_only() {
    let settings = ["sensor.fix.time_offset=\"0.1 s\"", "sensor.fix.update=\"ukf\""];
    let message = lab::refused(SCENARIO, &settings);
    assert!(
        message.contains("sensor.fix.update") && message.contains("update = \"ekf\""),
        "{message}"
    );
}
