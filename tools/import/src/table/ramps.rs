//! Positions that a program has interpolated to the rows of an inertial unit: straight lines between the fixes.

use super::columns::Table;
use super::units::median;

/// Bend at a fix against the usual one, which rounding makes.
const BEND: f64 = 5.0;
/// Least number of fixes, of rows between them, and the share of the fixes that are as far apart.
const FIXES: usize = 5;
const ROWS: usize = 3;
const SHARE: f64 = 0.8;

impl Table<'_> {
    /// Number of rows between the fixes of positions that lie on straight lines between them; `None` for measured ones.
    pub(super) fn ramps(&self) -> Option<usize> {
        let places = ["lat", "lon"].map(|channel| self.values(channel));
        let bend = |k: usize| {
            let of = |v: &Vec<f64>| (v[k + 1] - 2.0 * v[k] + v[k - 1]).abs();
            places.iter().map(of).fold(0.0, f64::max)
        };
        let rows = places[0].len().min(places[1].len());
        let bends: Vec<f64> = (1..rows.saturating_sub(1)).map(bend).collect();
        let usual = median(bends.iter().copied().filter(|b| *b > 0.0));
        let fixes: Vec<usize> = (0..bends.len()).filter(|k| bends[*k] > BEND * usual).collect();
        let gaps = || fixes.windows(2).map(|k| k[1] - k[0]);
        let apart = median(gaps().map(|gap| gap as f64)) as usize;
        let even = gaps().filter(|gap| *gap == apart).count();
        let often = even as f64 >= SHARE * (fixes.len().max(1) - 1) as f64;
        (fixes.len() >= FIXES && apart >= ROWS && often).then_some(apart)
    }
}

#[cfg(test)]
mod tests {
    use crate::table::recognise;

    #[test]
    fn positions_on_lines_between_fixes_are_asked_about() {
        // fixes with some noise each 20 rows
        let fix = |k: usize| 0.5 * k as f64 + ((k * k * 7) % 11) as f64;
        let table = |straight: bool| {
            let row = |k: usize| {
                let (before, part) = (k / 20, (k % 20) as f64 / 20.0);
                let line = fix(before) + part * (fix(before + 1) - fix(before));
                let metres = if straight { line } else { 0.1 * k as f64 + fix(k % 9) };
                let imu = format!("0.0{},0.01,0.02,0.1,0.2,-9.8{}", k % 7, k % 9);
                format!("{:.2},{imu},{:.9},{:.9}\n", k as f64 / 100.0, 48.0 + 1e-5 * metres, 11.0)
            };
            "t,gx,gy,gz,ax,ay,az,lat,lon\n".to_owned() + &(0..400).map(row).collect::<String>()
        };
        let asked = |text: &str| {
            let found = recognise(text, "").unwrap_or_default();
            let questions = found.iter().flat_map(|found| &found.questions);
            questions.filter(|q| q.contains("straight lines between fixes")).count()
        };
        assert_eq!([asked(&table(true)), asked(&table(false))], [1, 0]);
    }
}
