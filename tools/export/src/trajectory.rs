//! Trajectories of the TUM and KITTI benchmarks, as `evo` reads them. The frame is the tangent at
//! the first position.

use crate::{Axes, Fix, Form};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::time::Time;
use std::io::{self, Write};

/// The poses of a track, relative to its first position.
struct Poses {
    axes: Axes,
    origin: Option<Geodetic>,
}

impl Poses {
    /// Position, m, and the attitude from the body to the frame; level and to the north where the
    /// log has no attitude.
    fn pose(&mut self, fix: &Fix) -> (Vector3<f64>, Rotation3<f64>) {
        let origin = *self.origin.get_or_insert(fix.position);
        let ned = fix.position.ned_from(&origin);
        let c_b_n = fix.c_b_n().unwrap_or_else(Rotation3::identity);
        match self.axes {
            Axes::Ned => (ned, c_b_n),
            Axes::Enu => {
                // C_flu^enu = C_ned^enu C_frd^ned C_flu^frd
                let ned_enu = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
                let flu_frd = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
                let c = ned_enu * c_b_n.matrix() * flu_frd;
                (ned_enu * ned, Rotation3::from_matrix_unchecked(c))
            }
        }
    }
}

/// A line for each epoch: time, position, and the quaternion x, y, z, w.
pub struct Tum(Poses);

impl Tum {
    pub fn new(axes: Axes) -> Self {
        Self(Poses { axes, origin: None })
    }
}

/// Seconds with all nine decimals, exact also where they count from 1970.
fn seconds(time: Time) -> String {
    let nanos = time.nanos();
    let (sign, nanos) = (if nanos < 0 { "-" } else { "" }, nanos.unsigned_abs());
    format!("{sign}{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000)
}

impl Form for Tum {
    fn begin(&mut self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "# timestamp tx ty tz qx qy qz qw")
    }

    fn fix(&mut self, _: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()> {
        let (p, c) = self.0.pose(fix);
        let q = UnitQuaternion::from_rotation_matrix(&c);
        write!(out, "{} {:.6} {:.6} {:.6}", seconds(fix.time), p.x, p.y, p.z)?;
        writeln!(out, " {:.12} {:.12} {:.12} {:.12}", q.i, q.j, q.k, q.w)
    }

    fn end(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }
}

/// A line for each epoch: the upper three rows of the pose as a matrix, row by row.
pub struct Kitti(Poses);

impl Kitti {
    pub fn new(axes: Axes) -> Self {
        Self(Poses { axes, origin: None })
    }
}

impl Form for Kitti {
    fn begin(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }

    fn fix(&mut self, _: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()> {
        let (p, c) = self.0.pose(fix);
        for i in 0..3 {
            let separator = if i == 0 { "" } else { " " };
            write!(out, "{separator}{:.12e} {:.12e} {:.12e}", c[(i, 0)], c[(i, 1)], c[(i, 2)])?;
            write!(out, " {:.12e}", p[i])?;
        }
        writeln!(out)
    }

    fn end(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }
}
