//! Layouts of tables.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
use super::Layout;

#[test]
fn a_date_with_a_time_does_not_make_spaces_the_separator_of_rows_with_empty_cells() {
    let row = |k: usize| format!("11/14/2023 22:13:20.{k},0.1,-0.2,9.8,,,,,,\n");
    let head = "Session Start Time,11/14/2023 22:13:20\nTime,x,y,z,a,b,c,d,e,f\n";
    let text = head.to_owned() + &(0..9).map(row).collect::<String>();
    let layout = Layout::of(&text).unwrap();
    assert_eq!((layout.width(), layout.headings[0].as_str()), (10, "Time"));
}

#[test]
fn units_may_stand_above_the_headings_in_a_comment() {
    let head = "#yyyy-mm-dd, hh:mm:ss, ident, degrees, degrees, ft msl, kt\n \
                Lcl Date, Lcl Time, AtvWpt, Latitude, Longitude, AltMSL, GndSpd\n";
    let row = |k: usize| format!("2023-11-14, 22:13:{k}, KMUC, 48.1{k}, 11.5, 1640.{k}, 5\n");
    let layout = Layout::of(&(head.to_owned() + &(10..40).map(row).collect::<String>())).unwrap();
    assert_eq!(layout.units[5], "ft msl");
    assert_eq!(layout.headings[5], "AltMSL");
}

#[test]
fn a_row_that_numbers_the_columns_is_no_sample() {
    let head = "\"Time\",\"a\",\"b\",\"c\",\"d\"\n\"s\",\"g\",\"g\",\"g\",\"m\"\n\"1\",\"2\",\"3\",\"4\",\"5\"\n\n";
    let row = |k: usize| format!("\"{}\",\"0.1\",\"0.2\",\"0.{k}\",\"7\"\n", k as f64 / 9.0);
    let layout = Layout::of(&(head.to_owned() + &(0..30).map(row).collect::<String>())).unwrap();
    assert_eq!((layout.skip, layout.rows[0][1].as_str()), (4, "0.1"));
}
