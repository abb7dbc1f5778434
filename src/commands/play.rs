//! `navfuse play`.

use crate::commands::live::speed;
use crate::error::{CommandError, Result};
use crate::execution::input::document_of;
use crate::output::progress::{INTERRUPTED, stop_on_signal};
use clap::Args;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner::pass_samples;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::Sample;
use navfuse_dds::{PlayedTopic, PlayedType};
use navfuse_links::{serial_port, write_fix, write_sentence, write_water_linked};
use std::io::{self, Write};
use std::net::{TcpListener, UdpSocket};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Standard output as a place to send to.
const STANDARD_OUTPUT: &str = "-";
/// Beginning of a topic of ROS 2 as a place to send to.
const ROS2: &str = "ros2://";
/// Longest time for which a serial port may take no byte.
const FULL: Duration = Duration::from_secs(10);
/// Longest pause without a look at the signals.
const PAUSE: Duration = Duration::from_millis(20);

/// Arguments of `play`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse play runs/dive/run.mcap --to udp://127.0.0.1:5005
  navfuse play scenarios/surface-dive.toml --speed 10 --to tcp://127.0.0.1:5005
  navfuse play run.mcap --speed inf | navfuse live desk.toml --speed inf
  navfuse play run.mcap --to udp://127.0.0.1:5005 \\
      --to gnss=nmea:udp://127.0.0.1:10110 \\
      --to dvl=water-linked-json:tcp://127.0.0.1:16171
  navfuse play run.mcap --to imu=imu:ros2:///imu/data --to gnss=fix:ros2:///fix")]
pub struct Play {
    /// A log, or a scenario whose sources give the samples
    pub input: PathBuf,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Seconds of the recording in a second; inf sends without a pause
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = speed)]
    pub speed: f64,
    /// Place: udp://HOST:PORT sends there, tcp://HOST:PORT waits for a program that connects,
    /// serial://DEVICE@BAUD is a serial port, - is standard output. SENSOR=FORMAT:PLACE sends one
    /// sensor as an instrument does, with the format nmea or water-linked-json, or as a driver of
    /// ROS 2, with imu, fix, twist or pressure and ros2://TOPIC as place; may be given again
    #[arg(long, value_name = "[SENSOR=FORMAT:]PLACE", default_value = STANDARD_OUTPUT)]
    pub to: Vec<String>,
}

/// Sends the samples of a log or a scenario at the pace of their stamps.
pub fn play(registry: &Registry, arguments: &Play) -> Result<ExitCode> {
    let stop = stop_on_signal();
    let (document, mut settings) = document_of(&arguments.input)?;
    settings.extend_from_slice(&arguments.set);
    let assembly = Scenario::new(registry, document, &settings)?.assemble(None)?;
    let infos: Vec<_> = assembly.composition.sensors.iter().map(|s| s.info.clone()).collect();
    let mut places = Vec::new();
    for to in &arguments.to {
        places.push(Place::open(to, &infos, &stop)?);
    }
    let (begin, mut first, mut sent) = (Instant::now(), None, Ok(()));
    pass_samples(assembly, |sample| {
        let since = sample.time.since(*first.get_or_insert(sample.time)) / arguments.speed;
        wait(begin, since, &stop);
        let sensor = sample.sensor.0;
        let own = places.iter().position(|place| place.sensor == Some(sensor));
        let place = own.or_else(|| places.iter().position(|place| place.sensor.is_none()));
        if let Some(place) = place.and_then(|k| places.get_mut(k)) {
            sent = place.way.send(&infos[sensor], sample);
        }
        sent.is_ok() && !stop.load(Ordering::Relaxed)
    })?;
    for place in &mut places {
        sent = sent.and_then(|()| place.way.flush());
    }
    // a program that has enough closes the connection
    let ended = [io::ErrorKind::BrokenPipe, io::ErrorKind::ConnectionReset];
    if let Err(error) = sent
        && !ended.contains(&error.kind())
    {
        let to = PathBuf::from(arguments.to.join(", "));
        return Err(CommandError::file(&to, "cannot be written", "")(error));
    }
    Ok(if stop.load(Ordering::Relaxed) { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// Appends a sample to a text; false for a sample that the format cannot hold.
type Format = fn(&mut String, &SensorInfo, &Sample) -> bool;

/// A place to which samples are sent.
struct Place {
    /// The only sensor that is sent; `None` for all that have no place of their own.
    sensor: Option<usize>,
    way: Way,
}

/// The way to a place.
enum Way {
    /// Texts, and the last one.
    Text(Format, Box<dyn Write>, String),
    /// A topic of ROS 2.
    Topic(Box<PlayedTopic>),
}

impl Place {
    /// Opens `PLACE` or `SENSOR=FORMAT:PLACE`.
    fn open(to: &str, infos: &[SensorInfo], stop: &AtomicBool) -> Result<Self> {
        let wrong = |text: String| CommandError::argument(format!("--to {to:?}"), text);
        let text = |format: Format, place: &str| {
            Ok::<_, CommandError>(Way::Text(format, open(place, stop)?, String::new()))
        };
        let Some((name, rest)) = to.split_once('=') else {
            let format = |out: &mut String, info: &SensorInfo, sample: &Sample| {
                write_sentence(out, info, sample);
                true
            };
            return Ok(Self { sensor: None, way: text(format, to)? });
        };
        let sensor = infos.iter().position(|info| info.name == name);
        let sensor = sensor.ok_or_else(|| wrong(format!("there is no [sensor.{name}]")))?;
        let (format, place) = rest.split_once(':').unwrap_or_default();
        let message = PlayedType::ALL.into_iter().find(|(name, _)| *name == format);
        let way = match (format, message, place.strip_prefix(ROS2)) {
            ("nmea", ..) => text(write_fix, place)?,
            ("water-linked-json", ..) => text(write_water_linked, place)?,
            (_, Some((_, kind)), Some(topic)) => {
                let opened = PlayedTopic::open(kind, topic, None);
                Way::Topic(Box::new(opened.map_err(|error| wrong(error.to_string()))?))
            }
            _ => {
                let text = "the format is nmea or water-linked-json, followed by : and a \
                            destination, or imu, fix, twist or pressure with :ros2://TOPIC";
                return Err(wrong(text.to_owned()));
            }
        };
        Ok(Self { sensor: Some(sensor), way })
    }
}

impl Way {
    /// Sends a sample; one that the format cannot hold is left out.
    fn send(&mut self, info: &SensorInfo, sample: &Sample) -> io::Result<()> {
        match self {
            Self::Text(format, to, text) => {
                text.clear();
                if format(text, info, sample) { to.write_all(text.as_bytes()) } else { Ok(()) }
            }
            Self::Topic(topic) => topic.send(info, sample).map_err(io::Error::other),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Text(_, to, _) => to.flush(),
            Self::Topic(_) => Ok(()),
        }
    }
}

/// Waits until this many seconds have passed since the beginning.
fn wait(begin: Instant, seconds: f64, stop: &AtomicBool) {
    let Ok(due) = Duration::try_from_secs_f64(seconds) else { return };
    while let Some(left) = due.checked_sub(begin.elapsed())
        && !left.is_zero()
        && !stop.load(Ordering::Relaxed)
    {
        std::thread::sleep(left.min(PAUSE));
    }
}

/// A socket that sends each text as a datagram. Nobody has to listen.
struct Datagrams(UdpSocket);

impl Write for Datagrams {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.0.send(bytes) {
            Err(e) if e.kind() == io::ErrorKind::ConnectionRefused => Ok(bytes.len()),
            sent => sent,
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn open(to: &str, stop: &AtomicBool) -> Result<Box<dyn Write>> {
    if to == STANDARD_OUTPUT {
        return Ok(Box::new(io::BufWriter::new(io::stdout())));
    }
    let opened: Option<io::Result<Box<dyn Write>>> = match to.split_once("://") {
        Some(("udp", address)) => Some(udp(address)),
        Some(("tcp", address)) => Some(tcp(address, stop)),
        Some(("serial", port)) => Some(serial(port)),
        _ => None,
    };
    let wrong = |text: String| CommandError::argument(format!("--to {to:?}"), text);
    let example = "such as udp://127.0.0.1:5005, tcp://127.0.0.1:5005, \
                   serial:///dev/ttyUSB0@115200 or -";
    let opened = opened.ok_or_else(|| wrong(format!("this is no destination, {example}")))?;
    opened.map_err(|e| wrong(e.to_string()))
}

fn udp(address: &str) -> io::Result<Box<dyn Write>> {
    let socket = UdpSocket::bind("0.0.0.0:0")?;
    socket.connect(address)?;
    Ok(Box::new(Datagrams(socket)))
}

/// Opens `DEVICE@BAUD`.
fn serial(port: &str) -> io::Result<Box<dyn Write>> {
    let wrong = || io::Error::other("give the port and its rate: serial:///dev/ttyUSB0@115200");
    let (device, baud) = port.rsplit_once('@').ok_or_else(wrong)?;
    let baud = baud.parse().map_err(|_| wrong())?;
    Ok(Box::new(serial_port(device, baud, FULL)?))
}

/// Waits for a program that connects.
fn tcp(address: &str, stop: &AtomicBool) -> io::Result<Box<dyn Write>> {
    let server = TcpListener::bind(address)?;
    server.set_nonblocking(true)?;
    loop {
        match server.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                stream.set_nodelay(true)?;
                return Ok(Box::new(stream));
            }
            Err(e) if e.kind() != io::ErrorKind::WouldBlock => return Err(e),
            Err(_) if stop.load(Ordering::Relaxed) => return Ok(Box::new(io::sink())),
            Err(_) => std::thread::sleep(PAUSE),
        }
    }
}
