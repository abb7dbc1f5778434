//! Files in which the values of one row stand far from each other, or without a name: a value in each row, matrices, lists,
//! tables of a page, and lines of a log.

use super::*;

/// Names of the numbers of the IMU, and of a fix.
pub const IMU: [&str; 6] = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"];
pub const FIX: [&str; 3] = ["latitude", "longitude", "altitude"];

/// Time, name of the sensor, and the names and numbers of its channels.
type Sample = (i64, &'static str, Vec<(&'static str, f64)>);

pub fn fix(v: &[f64]) -> [f64; 3] {
    [v[0].to_degrees(), v[1].to_degrees(), v[2]]
}

/// The samples of both sensors in the order of their times.
fn samples(recorded: &Recorded) -> Vec<Sample> {
    let imu = recorded["imu"]
        .iter()
        .map(|(t, v)| (*t, "imu", IMU.into_iter().zip(v.iter().copied()).collect::<Vec<_>>()));
    let fixes =
        recorded["gnss"].iter().map(|(t, v)| (*t, "gps", FIX.into_iter().zip(fix(v)).collect()));
    let mut samples: Vec<Sample> = imu.chain(fixes).collect();
    samples.sort_by_key(|(t, ..)| *t);
    samples
}

/// The text of each value.
pub fn each(recorded: &Recorded, text: impl Fn(i64, &str, &str, f64) -> String) -> String {
    let of = |(t, sensor, values): &Sample| {
        values.iter().map(|(name, v)| text(*t, sensor, name, *v)).collect::<String>()
    };
    samples(recorded).iter().map(of).collect()
}

pub fn one(folder: &Path, name: &str, text: &str, offset: i64) -> Written {
    Written { given: vec![put(folder, name, text)], offset }
}

/// The rows of a matrix or a list of the IMU, and of fixes.
fn lists(recorded: &Recorded, row: impl Fn(String, &[f64]) -> String) -> [String; 2] {
    let imu = recorded["imu"].iter().map(|(t, v)| row(seconds(*t), &v[..6]));
    let fixes = recorded["gnss"].iter().map(|(t, v)| row(seconds(*t), &fix(v)));
    [imu.collect(), fixes.collect()]
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|v| format!("{v:.9}")).collect::<Vec<_>>().join(", ")
}

/// A time, six numbers of a matrix of MATLAB, and one for each fix.
fn matrices(recorded: &Recorded, heads: [&str; 2]) -> String {
    let [imu, fixes] =
        lists(recorded, |t, v| format!("  {t} {}; ...\n", numbers(v).replace(',', "")));
    format!("{} = [ ...\n{imu}];\n\n{} = [ ...\n{fixes}];\n", heads[0], heads[1])
}

/// The programs.
pub const PROGRAMS: [Program; 11] = [
    Program {
        name: "a sensor, a channel and its value in each row",
        write: |recorded, folder| {
            let rows = each(recorded, |t, sensor, name, v| {
                format!("{},{sensor},{name},{v:.9}\n", seconds(t + DATE))
            });
            one(folder, "long.csv", &("timestamp,sensor,channel,value\n".to_owned() + &rows), DATE)
        },
    },
    Program {
        name: "a log of MOOS, whose variables are a fraction of a millisecond apart",
        write: |recorded, folder| {
            let rows = each(recorded, |t, sensor, name, v| {
                let t = t + 100_000 * (name.len() as i64 % 3);
                let name = format!("{sensor}_{name}").to_uppercase();
                format!("{:<16} {name:<20} i{sensor} {v:.9}\n", seconds(t))
            });
            let head = "%%%%%%%%%%%%%%\n%% LOG FILE:       ./LOG.alog\n%% LOGSTART               1700000000.0\n";
            let note = "3.5      NODE_REPORT  pNode   NAME=a,SPD=1.5, MODE=x\n";
            one(folder, "LOG.alog", &(head.to_owned() + &rows + note), 0)
        },
    },
    Program {
        name: "annotated CSV of InfluxDB",
        write: |recorded, folder| {
            let mut text = String::new();
            for (sensor, names) in [("imu", &IMU[..]), ("gps", &FIX[..])] {
                for wanted in names {
                    text += "#datatype,string,long,dateTime:RFC3339,double,string,string\n#default,_result,,,,,\n\
                             ,result,table,_time,_value,_field,_measurement\n";
                    text += &each(recorded, |t, _, name, v| {
                        let t = t + DATE;
                        match name == *wanted {
                            true => {
                                format!(",,0,{}T{}Z,{v:.9},{name},{sensor}\n", day(t), clock(t))
                            }
                            false => String::new(),
                        }
                    });
                    text.push('\n');
                }
            }
            one(folder, "influx.csv", &text, DATE)
        },
    },
    Program {
        name: "JSON with pairs of a time and a value for each signal",
        write: |recorded, folder| {
            let names = IMU.iter().chain(&FIX);
            let signal = |wanted: &&str| {
                let pairs = each(recorded, |t, _, name, v| match name == *wanted {
                    true => format!("[{}, {v:.9}], ", (t + DATE) / 1000),
                    false => String::new(),
                });
                format!(
                    "\"{wanted}\": {{\"unit\": null, \"values\": [{}]}}",
                    pairs.trim_end_matches(", ")
                )
            };
            let signals = names.map(signal).collect::<Vec<_>>().join(", ");
            one(folder, "bus.json", &format!("{{{signals}}}"), DATE)
        },
    },
    Program {
        name: "matrices of MATLAB with a comment for each",
        write: |recorded, folder| {
            let heads = [
                "% imu: time [s], gyro x y z [rad/s], accel x y z [m/s^2]\nimu",
                "% t lat lon alt\ngps",
            ];
            one(folder, "data.m", &matrices(recorded, heads), 0)
        },
    },
    Program {
        name: "matrices of MATLAB without headings",
        write: |recorded, folder| {
            one(folder, "data.m", &matrices(recorded, ["imu_data", "gnss_data"]), 0)
        },
    },
    Program {
        name: "tables of HTML",
        write: |recorded, folder| {
            let page = |names: &[&str], rows: &str| {
                let titles: String = names.iter().map(|name| format!("<th>{name}</th>")).collect();
                format!(
                    "<html><body><h1>Log</h1>\n<table><tr><th>time</th>{titles}</tr>\n{rows}</table></body></html>"
                )
            };
            let [imu, fixes] = lists(recorded, |t, v| {
                format!("<tr><td>{t}</td><td>{}</td></tr>\n", numbers(v).replace(", ", "</td><td>"))
            });
            let given = vec![
                put(folder, "imu.html", &page(&IMU, &imu)),
                put(folder, "gps.html", &page(&FIX, &fixes)),
            ];
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "lists of a time and two vectors, as Python prints them",
        write: |recorded, folder| {
            let [imu, fixes] = lists(recorded, |t, v| match v.len() {
                6 => format!("({t}, [{}], [{}])\n", numbers(&v[..3]), numbers(&v[3..])),
                _ => format!("({t}, [{}])\n", numbers(v)),
            });
            Written {
                given: vec![put(folder, "imu.txt", &imu), put(folder, "gps.txt", &fixes)],
                offset: 0,
            }
        },
    },
    Program {
        name: "JSON with an object for each time",
        write: |recorded, folder| {
            let object = |wanted: &str| {
                let member = |(t, _, values): &Sample| {
                    let values = values.iter().map(|(name, v)| format!("\"{name}\": {v:.9}"));
                    let t = t + DATE;
                    format!(
                        "\"{}T{}\": {{{}}}",
                        day(t),
                        clock(t),
                        values.collect::<Vec<_>>().join(", ")
                    )
                };
                let samples = samples(recorded);
                let of = samples.iter().filter(|(_, sensor, _)| *sensor == wanted);
                format!("{{{}}}", of.map(member).collect::<Vec<_>>().join(","))
            };
            let given =
                ["imu", "gps"].map(|name| put(folder, &format!("{name}.json"), &object(name)));
            Written { given: given.to_vec(), offset: DATE }
        },
    },
    Program {
        name: "numbers behind the stamp and the node of a console",
        write: |recorded, folder| {
            let line = |(t, sensor, values): &Sample| {
                let values: Vec<f64> = values.iter().map(|(_, v)| *v).collect();
                format!("[INFO] [{}] [{sensor}_node]: {}\n", seconds(t + DATE), numbers(&values))
            };
            let text: String = samples(recorded).iter().map(line).collect();
            one(folder, "console.log", &text, DATE)
        },
    },
    Program {
        name: "gopro-telemetry, which names the first axis alone",
        write: |recorded, folder| {
            let stamp = |t: i64| {
                format!(
                    "{}.{:03},{}T{}Z",
                    t / 1_000_000,
                    t % 1_000_000 / 1000,
                    day(t + DATE),
                    clock(t + DATE)
                )
            };
            let vector = |head: &str, from: usize| {
                table(
                    &format!("\"cts\",\"date\",\"{head}\",\"1\",\"2\""),
                    &recorded["imu"],
                    |(t, v)| format!("{},{}", stamp(*t), cells(v[from..from + 3].iter().copied())),
                )
            };
            let head =
                "\"cts\",\"date\",\"GPS (Lat.) [deg]\",\"GPS (Long.) [deg]\",\"GPS (Alt.) [m]\"";
            let fixes =
                table(head, &recorded["gnss"], |(t, v)| format!("{},{}", stamp(*t), position(v)));
            let given = vec![
                put(folder, "ACCL.csv", &vector("Accelerometer [m/s2]", 3)),
                put(folder, "GYRO.csv", &vector("Gyroscope [rad/s]", 0)),
                put(folder, "GPS5.csv", &fixes),
            ];
            Written { given, offset: DATE }
        },
    },
];
