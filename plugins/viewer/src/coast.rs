//! The coastlines of the Earth, for a map without a network: Natural Earth 1:10 million, which is in the
//! public domain, thinned by `docs/coast`.

/// Pieces of lines, as `docs/coast` writes them.
const BYTES: &[u8] = include_bytes!("coast.bin");
/// Unit of the steps, deg.
const UNIT: f64 = 0.004;
/// Accuracy of a line in words: thinning moved it by 1.1 km at most, its points are rounded to 0.2 km, and
/// capes of the source are off by more.
pub const ACCURACY: &str = "3 km";

/// A place: latitude and longitude, deg.
type Place = [f64; 2];

/// The pieces of the coastlines of which a part is between the least and the greatest latitude and longitude,
/// deg.
pub fn within([low, high]: [Place; 2]) -> Vec<Vec<Place>> {
    let mut pieces = Vec::new();
    let mut rest = BYTES;
    while let Some(Head { count, length, corner, size }) = Head::read(&mut rest) {
        let Some((mut steps, others)) = rest.split_at_checked(length) else { break };
        rest = others;
        let degrees = |at: [i64; 2]| [at[1], at[0]].map(|x| UNIT * x as f64);
        // a box that is apart from the other one has no part in it
        let meets = |a: Place, b: Place| {
            (0..2).all(|k| a[k].min(b[k]) <= high[k] && a[k].max(b[k]) >= low[k])
        };
        if !meets(degrees(corner), degrees([0, 1].map(|k| corner[k] + size[k]))) {
            continue;
        }
        let mut at = corner;
        let mut piece: Vec<Place> = Vec::new();
        let mut before: Option<Place> = None;
        for _ in 0..count {
            let (Some(east), Some(north)) = (signed(&mut steps), signed(&mut steps)) else { break };
            at = [at[0] + east, at[1] + north];
            let place = degrees(at);
            match before.replace(place) {
                Some(from) if meets(from, place) => {
                    if piece.is_empty() {
                        piece.push(from);
                    }
                    piece.push(place);
                }
                _ => pieces.extend(Some(std::mem::take(&mut piece)).filter(|p| !p.is_empty())),
            }
        }
        pieces.extend(Some(piece).filter(|piece| !piece.is_empty()));
    }
    pieces
}

/// What stands before the points of a piece: their number, their length in bytes, and their box by its
/// south-western corner and its size, east and north.
struct Head {
    count: u64,
    length: usize,
    corner: [i64; 2],
    size: [i64; 2],
}

impl Head {
    fn read(bytes: &mut &[u8]) -> Option<Self> {
        Some(Self {
            count: number(bytes)?,
            length: usize::try_from(number(bytes)?).ok()?,
            corner: [signed(bytes)?, signed(bytes)?],
            size: [number(bytes)? as i64, number(bytes)? as i64],
        })
    }
}

/// Takes a number of variable length: 7 bits in a byte, least first.
fn number(bytes: &mut &[u8]) -> Option<u64> {
    let (mut number, mut shift) = (0_u64, 0);
    loop {
        let byte = *bytes.split_off_first()?;
        number |= u64::from(byte & 127).checked_shl(shift)?;
        if byte & 128 == 0 {
            return Some(number);
        }
        shift += 7;
    }
}

/// Takes a number with its sign in the lowest bit.
fn signed(bytes: &mut &[u8]) -> Option<i64> {
    let number = number(bytes)?;
    let half = (number >> 1) as i64;
    Some(if number & 1 == 0 { half } else { -half - 1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance of a place from the coast, km, along the segments around it.
    fn distance([latitude, longitude]: Place) -> f64 {
        let around = [[latitude - 0.3, longitude - 0.3], [latitude + 0.3, longitude + 0.3]];
        let cosine = latitude.to_radians().cos();
        let metric = |p: &Place| [(p[0] - latitude) * 111.2, (p[1] - longitude) * 111.2 * cosine];
        let from = |pair: &[Place]| {
            let [a, b] = [metric(&pair[0]), metric(&pair[1])];
            let along = [b[0] - a[0], b[1] - a[1]];
            let square = along[0].powi(2) + along[1].powi(2);
            let share = -(a[0] * along[0] + a[1] * along[1]) / square.max(1e-12);
            let share = share.clamp(0.0, 1.0);
            (a[0] + share * along[0]).hypot(a[1] + share * along[1])
        };
        let pieces = within(around);
        pieces.iter().flat_map(|piece| piece.windows(2).map(from)).fold(f64::INFINITY, f64::min)
    }

    /// Capes by their published coordinates; eleven capes were off by 0.03 to 2.4 km.
    #[test]
    fn capes_are_on_the_coast() {
        for (name, place) in [
            ("South Foreland", [51.1404, 1.3712]),
            ("Pointe du Raz", [48.0395, -4.7410]),
            ("Cape Reinga", [-34.4220, 172.6800]),
            ("Point Reyes", [37.9957, -123.0231]),
        ] {
            assert!(distance(place) < 3.0, "{name}: {} km", distance(place));
        }
    }

    #[test]
    fn all_lines_are_on_the_earth_and_the_open_sea_has_none() {
        let all = within([[-90.0, -180.0], [90.0, 180.0]]);
        // 128885 points, and the first one of a piece that continues another
        assert_eq!(all.iter().map(Vec::len).sum::<usize>(), 130_239);
        let inside = |p: &Place| p[0].abs() <= 90.0 && p[1].abs() <= 180.0;
        assert!(all.iter().flatten().all(inside));
        assert_eq!(within([[40.0, -35.0], [45.0, -30.0]]), Vec::<Vec<Place>>::new());
        // a strait is a small part of them
        let strait = within([[50.8, 1.0], [51.2, 2.0]]);
        assert!((2..500).contains(&strait.iter().map(Vec::len).sum::<usize>()));
    }
}
