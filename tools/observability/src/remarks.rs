//! Consequences of the segments for the states, and the agreement of Theorem 1 and its remarks with
//! the filter.

use crate::Determination;
use crate::report::StateReport;
use crate::theorem::{RemarkReport, SegmentView};
use crate::words::{AHEAD, TURN, short};

/// Names of the body axes, and the motion with a specific force along each.
const AXES: [(&str, &str); 3] = [("x", "forward"), ("y", "sideways"), ("z", "up or down")];
const ANGLES: [&str; 3] = ["roll", "pitch", "yaw"];

impl SegmentView {
    /// Returns the greatest change of heading after the start, deg, summed over the turns.
    pub fn heading_change_deg(&self) -> f64 {
        let mut heading = 0.0_f64;
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for change in self.segments.iter().filter_map(|s| s.heading_change_deg) {
            heading += change;
            (low, high) = (low.min(heading), high.max(heading));
        }
        high - low
    }

    /// Adds the explanation from the segments to states that are not determined.
    pub(crate) fn hint(&self, states: &mut [StateReport]) {
        let Some(sensor) = &self.sensor else { return };
        let (scale, misalignment) = (format!("{sensor}.scale"), format!("{sensor}.misalignment"));
        let turned = self.heading_change_deg();
        for s in states
            .iter_mut()
            .filter(|s| matches!(s.verdict, Determination::InPart | Determination::NotDetermined))
        {
            let rank = self.type_i.rank;
            let along = self.type_i.axis(0);
            if rank == 0 && (s.state == scale || s.state == misalignment) {
                s.missing = Some(format!(
                    "the specific force has not varied at constant attitude for 10 s or longer \
                     so far: {AHEAD}"
                ));
            } else if rank == 1 && s.state == misalignment && s.component == ANGLES[along] {
                let others: Vec<&str> =
                    [(0, "accelerate ahead"), (1, "thrust sideways"), (2, "dive")]
                        .iter()
                        .filter(|a| a.0 != along)
                        .map(|a| a.1)
                        .collect();
                let axis = AXES[along].0;
                s.missing = Some(format!(
                    "all specific-force rates so far are along the body's {axis} axis; {}",
                    others.join(" or ")
                ));
            } else if s.state.ends_with(".accel_bias") && s.component != "z" && turned < 45.0 {
                let so_far = if turned < 1.0 {
                    "no turn so far".to_owned()
                } else {
                    format!("only {turned:.0} deg of turns so far")
                };
                // An accelerometer bias is constant in body axes, while the gravity that a tilt
                // adds turns with the heading: only a turn separates the two.
                s.missing = Some(format!(
                    "{so_far}: without a turn the bias looks the same as a tilt; {TURN}"
                ));
            }
        }
    }

    /// States Theorem 1 and the remarks that apply.
    pub(crate) fn judged(&self, states: &[StateReport]) -> Vec<RemarkReport> {
        let Some(sensor) = &self.sensor else { return Vec::new() };
        let mut out = Vec::new();
        let (scale, misalignment) = (format!("{sensor}.scale"), format!("{sensor}.misalignment"));
        let ours = |s: &&StateReport| {
            let of_ins = [".attitude", ".velocity", ".gyro_bias", ".accel_bias"]
                .iter()
                .any(|e| s.state.ends_with(e));
            of_ins || s.state == scale || s.state == misalignment
        };
        let determined = |s: &StateReport| s.verdict == Determination::Determined;
        let open = |except: Option<&str>| -> Vec<String> {
            let rest = states
                .iter()
                .filter(ours)
                .filter(|s| !determined(s) && Some(s.title.as_str()) != except);
            rest.map(|s| format!("{} ({})", s.title, s.verdict.text())).collect()
        };
        // gyro biases converge slowly, as the paper notes on its Figure 8; the theorem gives no
        // time
        let slow = |title: &str| title.contains(".gyro_bias");
        let all_but_slow = |open: &[String]| open.iter().all(|o| slow(o));
        let listed = |open: &[String]| match open {
            [] => "all of them are determined".to_owned(),
            _ => format!("all of them are determined except {}", open.join(", ")),
        };
        let rank = self.type_i.rank;
        if let (Some(one), Some(two)) = (self.type_i_since_s, self.type_ii_since_s) {
            let left = open(None);
            let text = format!(
                "both conditions hold since {:.0} s: the specific-force rates have {rank} \
                 directions since {one:.0} s, and the points alpha are not coplanar since \
                 {two:.0} s. The states of the theorem are observable; in the filter {}",
                one.max(two),
                listed(&left)
            );
            out.push(RemarkReport { about: "theorem-1", text, agrees: all_but_slow(&left) });
        } else {
            let mut why = Vec::new();
            if self.type_i_since_s.is_none() {
                why.push(match rank {
                    0 => "the specific force never varies at constant attitude".to_owned(),
                    _ => format!(
                        "all specific-force rates are along one direction, the body's {} axis",
                        AXES[self.type_i.axis(0)].0
                    ),
                });
            }
            if self.type_ii_since_s.is_none() {
                why.push(match &self.type_ii {
                    None => "there is no turn".to_owned(),
                    Some(s) => format!(
                        "the points alpha of the turns are coplanar: singular values {}, {} and \
                         {} m/s^2, noise {}",
                        short(s.singular_values[0]),
                        short(s.singular_values[1]),
                        short(s.singular_values[2]),
                        short(s.noise)
                    ),
                });
            }
            let text = format!("the conditions do not hold: {}", why.join("; "));
            out.push(RemarkReport { about: "theorem-1", text, agrees: true });
        }
        let mis =
            |k: usize| states.iter().find(|s| s.state == misalignment && s.component == ANGLES[k]);
        if rank >= 2 {
            let (first, second) = (self.type_i.axis(0), self.type_i.axis(1));
            let vertical = first == 2 || second == 2;
            let agrees = (0..3).all(|k| mis(k).is_none_or(determined));
            let all = if agrees {
                "all three angles of the misalignment are determined"
            } else {
                "but not all three angles of the misalignment are determined"
            };
            let (about, how) = if vertical {
                ("remark-4", "diving or climbing adds a direction to that of the thrust")
            } else {
                ("remark-1", "the thrusters give forces in different directions")
            };
            let text = format!(
                "{how}: specific-force rates along the body's {} and {} axes; {all}",
                AXES[first].0, AXES[second].0
            );
            out.push(RemarkReport { about, text, agrees });
        } else if rank == 1 {
            let along = self.type_i.axis(0);
            let (axis, name) = AXES[along];
            let angle = mis(along);
            let title = angle
                .map_or_else(|| format!("{misalignment} {}", ANGLES[along]), |s| s.title.clone());
            let undetermined = angle.is_none_or(|s| !determined(s));
            let verdict = angle.map_or("not estimated", |s| s.verdict.text());
            let text = format!(
                "all specific-force rates are along the body's {axis} axis ({name}), so the angle \
                 about this axis, {title}, is not observable; it is {verdict}"
            );
            out.push(RemarkReport { about: "remark-2", text, agrees: undetermined });
            if self.heading_change_deg() >= 45.0 {
                let left = open(Some(&title));
                let text = format!(
                    "with turns all other states are observable: besides {title}, {}",
                    listed(&left)
                );
                out.push(RemarkReport {
                    about: "remark-3",
                    text,
                    agrees: undetermined && all_but_slow(&left),
                });
            }
        }
        let biases: Vec<&StateReport> =
            states.iter().filter(|s| s.state.ends_with(".accel_bias")).collect();
        let coplanar = self.type_ii.as_ref().filter(|s| s.rank < 3);
        if let Some(s) =
            coplanar.filter(|_| !biases.is_empty() && biases.iter().all(|b| determined(b)))
        {
            let text = format!(
                "the points alpha are coplanar (smallest singular value {} m/s^2, noise {}), but \
                 the accelerometer biases are determined: the change of heading, {:.0} deg, is \
                 enough, since a bias turns with the heading and a tilt does not",
                short(s.singular_values[2]),
                short(s.noise),
                self.heading_change_deg()
            );
            out.push(RemarkReport { about: "not-necessary", text, agrees: true });
        }
        out
    }
}
