//! Position, velocity and attitude in a log.

use nalgebra::{Rotation3, Vector3};
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::time::Time;
use navfuse_mcap::{BlockEntry, Entry, LogReader};
use std::path::{Path, PathBuf};

/// The estimate at one epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// The epoch.
    pub time: Time,
    /// Position on WGS 84; height above the ellipsoid.
    pub position: Geodetic,
    /// 1-sigma of the position: north, east, down, m.
    pub position_sigma: Vector3<f64>,
    /// Velocity north, east, down, m/s, and its 1-sigma.
    pub velocity: Option<[Vector3<f64>; 2]>,
    /// Roll, pitch and yaw, rad, and their 1-sigma.
    pub attitude: Option<[Vector3<f64>; 2]>,
}

impl Fix {
    /// Latitude and longitude, deg.
    pub fn degrees(&self) -> [f64; 2] {
        [self.position.latitude, self.position.longitude].map(f64::to_degrees)
    }

    /// The attitude `C_b^n`, from the body to north, east, down.
    pub fn c_b_n(&self) -> Option<Rotation3<f64>> {
        self.attitude.map(|[a, _]| Rotation3::from_euler_angles(a.x, a.y, a.z))
    }
}

/// Reads the estimates of a log, epoch by epoch.
pub struct Fixes {
    path: PathBuf,
    log: LogReader,
    /// Name of the block of the position, the first that the log has.
    position: Option<String>,
    /// The epoch whose blocks are being read.
    now: Partial,
    /// Epochs without a finite position.
    invalid: u64,
    ended: bool,
}

/// The blocks of an epoch that were read so far.
#[derive(Clone, Copy, Debug, Default)]
struct Partial {
    time: Option<Time>,
    position: Option<(Geodetic, Vector3<f64>)>,
    velocity: Option<[Vector3<f64>; 2]>,
    attitude: Option<[Vector3<f64>; 2]>,
}

impl Partial {
    fn fix(self) -> Option<Fix> {
        let (position, position_sigma) = self.position?;
        let Self { velocity, attitude, .. } = self;
        Some(Fix { time: self.time?, position, position_sigma, velocity, attitude })
    }
}

impl Fixes {
    /// Opens a log.
    ///
    /// # Errors
    /// When the file cannot be read, is no MCAP file, or was not recorded by navfuse.
    pub fn open(path: &Path) -> Result<Self, StreamError> {
        Ok(Self {
            path: path.to_path_buf(),
            log: LogReader::open(path)?,
            position: None,
            now: Partial::default(),
            invalid: 0,
            ended: false,
        })
    }

    /// Number of bytes read, and length of the file.
    pub fn progress(&self) -> [u64; 2] {
        self.log.progress()
    }

    /// Reads the next epoch; `None` at the end.
    ///
    /// # Errors
    /// When the log is damaged.
    #[allow(clippy::should_implement_trait, reason = "it can fail")]
    pub fn next(&mut self) -> Result<Option<Fix>, StreamError> {
        while !self.ended {
            let (name, now, mut done) = (&mut self.position, &mut self.now, None);
            self.ended = !self.log.next(|entry| {
                let Entry::Block(block) = entry else { return };
                if now.time.is_some_and(|time| time != block.time) {
                    done = Some(std::mem::take(now));
                }
                now.time = Some(block.time);
                take(now, name, &block);
            })?;
            if self.ended {
                done = Some(std::mem::take(&mut self.now));
            }
            let Some(done) = done else { continue };
            let finite = |p: &(Geodetic, Vector3<f64>)| {
                let Geodetic { latitude, longitude, height } = p.0;
                [latitude, longitude, height].iter().all(|v| v.is_finite())
            };
            match done.fix() {
                Some(fix) if finite(&(fix.position, fix.position_sigma)) => return Ok(Some(fix)),
                Some(_) => self.invalid += 1,
                None => {}
            }
        }
        Ok(None)
    }

    /// Tests whether there was a position, after the last epoch.
    ///
    /// # Errors
    /// When there was none.
    pub fn check(&self, epochs: u64) -> Result<(), StreamError> {
        if epochs > 0 {
            return Ok(());
        }
        let (message, remedy) = if self.position.is_none() {
            (
                "the log has no estimate of a geodetic position",
                "use --to csv or --to parquet, which have every state",
            )
        } else {
            ("no estimate of the position is finite", "read the events of the log for the reason")
        };
        Err(StreamError::format(message).in_file(&self.path).with_remedy(remedy))
    }

    /// Warnings after the last epoch.
    pub fn warnings(&self) -> Vec<String> {
        let invalid = (self.invalid > 0)
            .then(|| format!("{} epochs without a finite position are left out", self.invalid));
        self.log.warning().into_iter().chain(invalid).collect()
    }
}

/// Takes the block of the position, and those of velocity and attitude with the same owner.
fn take(now: &mut Partial, position: &mut Option<String>, block: &BlockEntry<'_>) {
    let (&[a, b, c], &[sa, sb, sc]) = (block.estimate.as_slice(), block.sigma.as_slice()) else {
        return;
    };
    let (value, sigma) = (Vector3::new(a, b, c), Vector3::new(sa, sb, sc));
    let finite = value.iter().all(|v| v.is_finite());
    if block.geodetic {
        if position.get_or_insert_with(|| block.name.to_owned()) == block.name {
            let geodetic =
                Geodetic { latitude: a.to_radians(), longitude: b.to_radians(), height: c };
            now.position = Some((geodetic, sigma));
        }
        return;
    }
    // the blocks of a process stand together; a sensor's angles come later
    match block.components.as_slice() {
        ["north", "east", "down"] if block.unit == "m/s" && finite => {
            now.velocity.get_or_insert([value, sigma]);
        }
        ["roll", "pitch", "yaw"] if block.unit == "deg" && finite => {
            now.attitude.get_or_insert([value, sigma].map(|v| v.map(f64::to_radians)));
        }
        _ => {}
    }
}
