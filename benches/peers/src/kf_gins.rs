//! KF-GINS: 21 states, double precision, in C++. It is in no registry, so a checkout of it is given
//! to the program, which compiles it with the harness `kf-gins/step.cpp` and Eigen.

use crate::{Imu, Peer};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Folder of Eigen, unless the variable `EIGEN` names another.
const EIGEN: &str = "/usr/include/eigen3";

pub struct KfGins {
    child: Child,
    asked: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peer for KfGins {
    fn name(&self) -> &'static str {
        "KF-GINS, 21 states, f64"
    }
    fn restart(&mut self) {}
    fn propagate(&mut self) {
        self.time();
    }
    fn time(&mut self) -> f64 {
        self.asked.write_all(b".").unwrap();
        let mut answer = String::new();
        self.answers.read_line(&mut answer).unwrap();
        let mut numbers = answer.split_whitespace().map(|text| text.parse::<f64>().unwrap());
        let (spent, trace) = (numbers.next().unwrap(), numbers.next().unwrap());
        assert!(trace.is_finite(), "the covariance of KF-GINS is no longer finite");
        spent
    }
}

impl Drop for KfGins {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Compiles and starts the checkout in a folder.
pub fn filter(checkout: &Path, samples: &[Imu]) -> KfGins {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = std::env::current_exe().unwrap().with_file_name("kf-gins");
    let engine = checkout.join("src");
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    let eigen = std::env::var("EIGEN").unwrap_or_else(|_| EIGEN.into());
    let mut command = Command::new(&compiler);
    command.args(["-O3", "-DNDEBUG", "-std=c++14", "-I", &eigen, "-I"]).arg(&engine);
    command.arg(here.join("kf-gins/step.cpp"));
    command.args(["gi_engine.cpp", "insmech.cpp"].map(|file| engine.join("kf-gins").join(file)));
    let compiled = command.arg("-o").arg(&program).status().unwrap();
    assert!(compiled.success(), "{compiler} cannot compile {}", checkout.display());

    let mut command = Command::new(program);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let (mut asked, answers) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    let mut bytes = (samples.len() as u64).to_ne_bytes().to_vec();
    for imu in samples {
        let increments = imu.rate.iter().chain(&imu.force).map(|mean| mean * imu.interval);
        for number in [imu.time, imu.interval].into_iter().chain(increments) {
            bytes.extend(number.to_ne_bytes());
        }
    }
    asked.write_all(&bytes).unwrap();
    KfGins { child, asked, answers: BufReader::new(answers) }
}
