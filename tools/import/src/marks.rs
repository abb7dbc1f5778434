//! The marks of formats that `import` does not read, so that a refusal names the format.

/// The place of a mark in a file, the mark, and the format with a remedy.
type Mark = (usize, &'static [u8], &'static str, &'static str);

const TABLE: &str = "export it as a table (CSV) with a heading for each column";
const QUERY: &str = "export each of its tables as CSV, such as with `.mode csv` and `.headers on` of sqlite3, or with COPY";
const UNPACK: &str = "unpack it and give its files";
const SOLVE: &str = "compute its positions, such as with rnx2rtkp of RTKLIB, and give these";
const CONVERT: &str = "export its IMU and GNSS as a table (CSV), or convert it to a bag of ROS 2";

/// Marks of at least four bytes: no other format begins like this.
const LONG: [Mark; 39] = [
    (0, b"\x93NUMPY", "an array of NumPy (.npy)", TABLE),
    (0, b"PK\x03\x04", "a ZIP archive (.zip, .npz, .xlsx)", UNPACK),
    (0, b"MATLAB 5.0 MAT-file", "a file of MATLAB (.mat)", TABLE),
    (0, b"\x89HDF\r\n\x1a\n", "an HDF5 file (MATLAB 7.3, NetCDF 4)", TABLE),
    (0, b"CDF\x01", "a NetCDF file", TABLE),
    (0, b"CDF\x02", "a NetCDF file", TABLE),
    (0, b"PAR1", "a Parquet file", TABLE),
    (0, b"ARROW1", "a file of Apache Arrow", TABLE),
    (0, b"FEA1", "a Feather file", TABLE),
    (
        4,
        b"ftyp",
        "a film (MP4)",
        "export its IMU and GNSS as a table (CSV), such as with gopro-telemetry",
    ),
    (
        0,
        b"H Product:Blackbox",
        "a log of Betaflight",
        "export it as a table (CSV) with blackbox_decode",
    ),
    (0, b"SQLite format 3\0", "a database of SQLite", QUERY),
    (0, b"PRAGMA ", "a database of SQLite as commands (.dump)", QUERY),
    (0, b"CREATE TABLE", "a database as commands of SQL", QUERY),
    (0, b"INSERT INTO", "a database as commands of SQL", QUERY),
    (
        0,
        b"FTP NEW",
        "a raw file of HYPACK",
        "export its devices as a table (CSV), one file for each",
    ),
    (0, b"BEGIN TRANSACTION;", "a database as commands of SQL", QUERY),
    (0, b"-- MySQL dump", "a database as commands of SQL", QUERY),
    (0, b"--\n-- PostgreSQL", "a database as commands of SQL", QUERY),
    (0, b"%PDF-", "a PDF document", TABLE),
    (0, b"{\\rtf", "a text document", TABLE),
    (0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "a document of Microsoft Office (.xls)", TABLE),
    (0, b"\x89PNG\r\n", "a picture (PNG)", TABLE),
    (0, b"\xff\xd8\xff\xe0", "a picture (JPEG)", TABLE),
    (0, b"\xff\xd8\xff\xe1", "a picture (JPEG)", TABLE),
    (0, b"\x7fELF", "a program", TABLE),
    (0, b"\xd4\xc3\xb2\xa1", "a capture of network packets (pcap)", CONVERT),
    (0, b"\xa1\xb2\xc3\xd4", "a capture of network packets (pcap)", CONVERT),
    (0, b"\x4d\x3c\xb2\xa1", "a capture of network packets (pcap)", CONVERT),
    (0, b"\x0a\x0d\x0d\x0a", "a capture of network packets (pcapng)", CONVERT),
    (0, b"\xfd7zXZ\0", "a file packed with xz", UNPACK),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", UNPACK),
    (0, b"Rar!\x1a\x07", "a RAR archive", UNPACK),
    (0, b"BZh91AY&SY", "a file packed with bzip2", UNPACK),
    (257, b"ustar", "a tar archive", UNPACK),
    (0, b"MDF     ", "a measurement in MDF (.mf4, .mdf)", TABLE),
    (0, b"TDSm", "a file of LabVIEW (.tdms)", TABLE),
    (60, b"RINEX VERSION / TYPE", "a file of RINEX", SOLVE),
    (20, b"OBSERVATION DATA", "a file of RINEX", SOLVE),
];

/// Marks of messages of receivers and inertial units, which other bytes may resemble: they name a
/// file that nothing else recognises.
const SHORT: [Mark; 4] = [
    (0, b"\xd3\x00", "messages of RTCM", CONVERT),
    (8, b".FIT", "a FIT file of a sports device", TABLE),
    (0, b"\x80\x04\x95", "an object of Python (pickle)", TABLE),
    (0, b"\x80\x05\x95", "an object of Python (pickle)", TABLE),
];

fn find(marks: &[Mark], beginning: &[u8]) -> Option<[&'static str; 2]> {
    let fits = |m: &&Mark| beginning.get(m.0..).is_some_and(|rest| rest.starts_with(m.1));
    marks.iter().find(fits).map(|(_, _, name, remedy)| [*name, *remedy])
}

/// The name of a format that is not read, with a remedy, by a mark that decides.
pub fn known(beginning: &[u8]) -> Option<[&'static str; 2]> {
    find(&LONG, beginning)
}

/// The same by a short mark, for a file that has no other format.
pub fn likely(beginning: &[u8]) -> Option<[&'static str; 2]> {
    find(&SHORT, beginning)
}
