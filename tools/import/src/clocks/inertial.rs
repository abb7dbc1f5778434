//! The integrals of an IMU: angles, and velocities with gravity removed.

/// Gravity, m/s^2. An error of it changes the vertical axis alone, which is not used.
const GRAVITY: f64 = 9.81;
/// Longest time in seconds over which the specific force levels the IMU.
const LEVELLING: f64 = 60.0;
/// Largest number of rows of the IMU; beyond, every other one is removed.
const ROWS: usize = 1 << 18;

/// The integrals of an IMU.
#[derive(Clone, Debug, Default)]
pub struct Inertial {
    /// Unit vector down, in body axes.
    down: Option<[f64; 3]>,
    begin: f64,
    /// Angle (rad) and velocity (m/s) along the body's axes, and the angle about the vertical.
    sums: [f64; 7],
    /// Time and sums.
    rows: Vec<[f64; 8]>,
    /// The vector down at the times of the rows.
    downs: Vec<[f32; 3]>,
    /// Least interval of rows, s.
    spacing: f64,
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let norm = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    (norm > 0.0 && norm.is_finite()).then(|| a.map(|x| x / norm))
}

/// Removes every other element, from the second on.
fn every_other<T>(rows: &mut Vec<T>) {
    let mut keep = false;
    rows.retain(|_| {
        keep = !keep;
        keep
    });
}

impl Inertial {
    /// Takes the mean angular rate and specific force of the interval that ends at a time.
    pub fn add(&mut self, time: f64, interval: f64, rate: [f64; 3], force: [f64; 3]) {
        let Some(measured) = unit(force.map(|f| -f)) else { return };
        let before = *self.down.get_or_insert_with(|| {
            self.begin = time;
            measured
        });
        // d' = d x w for a vector that rests in space; the measured one corrects it slowly, and at
        // once in the beginning
        let turned = cross(before, rate);
        let gain = interval / self.levelling(time);
        let moved: [f64; 3] = std::array::from_fn(|k| {
            before[k] + interval * turned[k] + gain * (measured[k] - before[k])
        });
        let down = unit(moved).unwrap_or(measured);
        self.down = Some(down);
        for k in 0..3 {
            self.sums[k] += rate[k] * interval;
            self.sums[3 + k] += (force[k] + GRAVITY * down[k]) * interval;
        }
        // psi' = (w_y sin phi + w_z cos phi) / cos theta, with the angles in the vector down
        let level = 1.0 - down[0] * down[0];
        if level > 0.01 {
            self.sums[6] += (rate[1] * down[1] + rate[2] * down[2]) / level * interval;
        }
        if self.rows.last().is_none_or(|row| time - row[0] >= self.spacing) {
            if self.rows.len() >= ROWS {
                every_other(&mut self.rows);
                every_other(&mut self.downs);
                self.spacing = (2.0 * self.spacing).max(2.0 * interval);
            }
            let s = self.sums;
            self.rows.push([time, s[0], s[1], s[2], s[3], s[4], s[5], s[6]]);
            self.downs.push(down.map(|x| x as f32));
        }
    }

    /// The time, s, over which the specific force levels the IMU: less in the beginning.
    pub fn levelling(&self, time: f64) -> f64 {
        (time - self.begin).clamp(1.0, LEVELLING)
    }

    /// Times of the first and the last row.
    pub fn span(&self) -> Option<[f64; 2]> {
        Some([self.rows.first()?[0], self.rows.last()?[0]])
    }

    /// The unit vector down in the axes of the body at a time; `None` after the last row.
    pub fn down_at(&self, time: f64) -> Option<[f64; 3]> {
        let after = self.rows.partition_point(|row| row[0] < time);
        self.downs.get(after).map(|down| down.map(f64::from))
    }

    /// The integrals at a time, between two rows: three angles, three velocities, and the angle about
    /// the vertical; `None` outside of them.
    pub fn at(&self, time: f64) -> Option<[f64; 7]> {
        let after = self.rows.partition_point(|row| row[0] < time);
        let (a, b) = (self.rows.get(after.checked_sub(1)?)?, self.rows.get(after)?);
        let share = (time - a[0]) / (b[0] - a[0]);
        Some(std::array::from_fn(|k| a[k + 1] + share * (b[k + 1] - a[k + 1])))
    }
}
