//! Draws sample figures of a run: `cargo run -p navfuse-figures --example sample -- FOLDER`.

use navfuse_figures::{Axis, Band, Curve, Figure, Look, Panel, svg};

/// Returns a pseudo-random number between -1 and 1.
fn noise(k: usize) -> f64 {
    let x = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    ((x >> 11) as f64 / (1u64 << 52) as f64) - 1.0
}

fn curve(name: &str, look: Look, f: impl Fn(usize) -> [f64; 2]) -> Curve {
    Curve { name: name.into(), look, points: (0..300).map(f).collect() }
}

/// State that converges: its error, and the bounds of 3 sigma.
fn state(k: usize, size: f64, label: &str, title: &str) -> Panel {
    let sigma = move |i: usize| size * (0.02 + (-(i as f64) / 40.0).exp());
    let time = |i: usize| 6.9 * i as f64;
    Panel {
        title: title.into(),
        x: Axis::time(),
        y: Axis::linear(label),
        curves: vec![
            curve("error", Look::Data(0), |i| {
                [time(i), sigma(i) * (0.6 * noise(k) + 0.4 * noise(1000 * k + i))]
            }),
            curve("±3 sigma", Look::Sigma, |i| [time(i), 3.0 * sigma(i)]),
            curve("±3 sigma", Look::Sigma, |i| [time(i), -3.0 * sigma(i)]),
        ],
        bands: vec![],
    }
}

/// The same state on a logarithmic axis.
fn decay(k: usize, size: f64, label: &str, title: &str) -> Panel {
    let sigma = move |i: usize| size * (1e-3 + (-(i as f64) / 20.0).exp());
    let time = |i: usize| 6.9 * i as f64;
    Panel {
        title: title.into(),
        x: Axis::time(),
        y: Axis::logarithmic(label),
        curves: vec![
            curve("rms error of 50 runs", Look::Data(0), |i| {
                [time(i), sigma(i) * (1.0 + 0.15 * noise(1000 * k + i))]
            }),
            curve("mean sigma", Look::Sigma, |i| [time(i), sigma(i)]),
        ],
        bands: vec![],
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    let names = [
        ("attitude", 2.0, "deg"),
        ("velocity", 0.5, "m/s"),
        ("position", 30.0, "m"),
        ("gyro bias", 1.0, "deg/h"),
    ];
    let mut panels = Vec::new();
    for (b, (name, size, unit)) in names.into_iter().enumerate() {
        for (c, axis) in ["north", "east", "down"].into_iter().enumerate() {
            panels.push(state(
                3 * b + c,
                size,
                &format!("error [{unit}]"),
                &format!("{name} {axis}"),
            ));
        }
    }
    let errors = Figure {
        name: "errors".into(),
        title: "Errors and uncertainty".into(),
        columns: 3,
        panels,
    };
    let panels = (0..19)
        .map(|k| {
            decay(
                k,
                [2.0, 1e-2, 300.0][k % 3],
                ["sigma [deg]", "sigma [m/s]", "sigma [m]"][k % 3],
                &format!("state {k}"),
            )
        })
        .collect();
    let decades = Figure {
        name: "sigmas".into(),
        title: "50 runs: rms error and sigma".into(),
        columns: 4,
        panels,
    };
    let nees = Panel {
        title: "NEES of the whole state, mean of 50 runs".into(),
        x: Axis::time(),
        y: Axis::linear("NEES / n"),
        curves: vec![
            curve("mean NEES", Look::Data(0), |i| [6.9 * i as f64, 1.0 + 0.2 * noise(i)]),
            curve("expected", Look::Bound, |i| [6.9 * i as f64, 1.0]),
        ],
        bands: vec![Band {
            name: "95 % of a chi-square".into(),
            points: (0..300).map(|i| [6.9 * i as f64, 0.83, 1.18]).collect(),
        }],
    };
    let track = Panel {
        title: "Track".into(),
        x: Axis::linear("east [m]"),
        y: Axis::linear("north [m]"),
        curves: vec![
            curve("truth", Look::Truth, |i| {
                [800.0 * (i as f64 / 40.0).sin(), 500.0 * (i as f64 / 80.0).sin()]
            }),
            curve("estimate", Look::Data(0), |i| {
                [800.0 * (i as f64 / 40.0).sin() + 0.1 * i as f64, 500.0 * (i as f64 / 80.0).sin()]
            }),
        ],
        bands: vec![],
    };
    let allan = Panel {
        title: "Allan deviation".into(),
        x: Axis::logarithmic("tau [s]"),
        y: Axis::logarithmic("deviation [deg/h]"),
        curves: vec![
            curve("x", Look::Data(0), |i| {
                [0.01 * 1.04f64.powi(i as i32), 1.0 / (0.01 * 1.04f64.powi(i as i32)).sqrt() + 0.01]
            }),
            curve("z", Look::Data(2), |i| {
                [0.01 * 1.04f64.powi(i as i32), 2.0 / (0.01 * 1.04f64.powi(i as i32)).sqrt() + 0.03]
            }),
        ],
        bands: vec![],
    };
    let innovation = Panel {
        title: "vel_x".into(),
        x: Axis::time(),
        y: Axis::linear("innovation [m/s]"),
        curves: vec![
            curve("accepted", Look::Points(0), |i| [6.9 * i as f64, 0.02 * noise(i)]),
            curve("gated", Look::Points(1), |i| {
                [6.9 * i as f64, if i % 37 == 5 { 0.05 + 0.01 * noise(i) } else { f64::NAN }]
            }),
            curve("±3 sigma", Look::Bound, |i| [6.9 * i as f64, 0.03]),
            curve("±3 sigma", Look::Bound, |i| [6.9 * i as f64, -0.03]),
        ],
        bands: vec![],
    };
    let empty = Panel {
        title: "a sensor without samples".into(),
        x: Axis::time(),
        y: Axis::linear("range [m]"),
        curves: vec![],
        bands: vec![],
    };
    let mixed = Figure {
        name: "mixed".into(),
        title: "Different panels".into(),
        columns: 2,
        panels: vec![nees.clone(), track, allan, innovation, empty],
    };
    let single =
        Figure { name: "nees".into(), title: "Consistency".into(), columns: 1, panels: vec![nees] };
    for figure in [errors, decades, mixed, single] {
        let picture = svg(&figure)?;
        println!("{}: {} bytes", figure.name, picture.len());
        std::fs::write(
            std::path::Path::new(&folder).join(format!("{}.svg", figure.name)),
            picture,
        )?;
    }
    Ok(())
}
