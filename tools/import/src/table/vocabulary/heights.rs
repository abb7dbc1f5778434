//! Heights with the zero from which they count.

/// Words for a height, for the zero from which it counts, and between both.
const HEIGHTS: [&str; 8] = ["height", "altitude", "alt", "elevation", "elev", "ele", "hgt", "ht"];
const ELLIPSOID: [&str; 9] =
    ["ellipsoid", "ellipsoidal", "ellips", "ellip", "ell", "hae", "wgs84", "wgs", "geodetic"];
const SEA: [&str; 9] =
    ["msl", "amsl", "asl", "sea", "level", "mean", "baro", "geoid", "orthometric"];
const BETWEEN: [&str; 5] = ["above", "abv", "over", "the", "84"];
/// Ranks of heights above the ellipsoid, and above the sea.
const ABOVE: [usize; 2] = [4, 40];

/// Tests whether a word is the zero of a height.
pub fn is_zero(word: &str) -> bool {
    ELLIPSOID.contains(&word) || SEA.contains(&word) || word == "agl"
}

/// The rank of words for a height and its zero, as `heightAboveEllipsoid`: one above the ellipsoid is better than one
/// above the sea.
pub fn height(words: &[&str]) -> Option<usize> {
    let of = |names: &[&str]| words.iter().any(|w| names.contains(w));
    let all = [&HEIGHTS[..], &ELLIPSOID, &SEA, &BETWEEN].concat();
    let named = of(&HEIGHTS) || words == ["msl"] || words == ["amsl"];
    let whole = named && words.len() < 6 && words.iter().all(|w| all.contains(w));
    let rank = if of(&ELLIPSOID) { ABOVE[0] } else { ABOVE[1] };
    (whole && !of(&["baro"]) && (of(&ELLIPSOID) || of(&SEA))).then_some(rank)
}

#[cfg(test)]
mod tests {
    use crate::table::vocabulary::{expression, meaning};

    #[test]
    fn a_height_above_the_ellipsoid_is_better_than_one_above_the_sea() {
        let rank =
            |heading: &str| meaning(heading).filter(|m| m.channel == "height").map(|m| m.rank);
        for [ellipsoid, sea] in [
            ["altHAE", "altMSL"],
            ["gnss1_heightAboveEllipsoid", "gnss1_heightAboveMsl"],
            ["Ellipsoidal Height (m)", "Height above mean sea level (m)"],
            ["Ht Abv Ellips [x8103]", "Ht Abv MSL [x8103]"],
        ] {
            let [a, b] = [ellipsoid, sea].map(rank);
            assert!(a.is_some() && b.is_some() && a < b, "{ellipsoid} {a:?} {sea} {b:?}");
        }
        assert_eq!(rank("baro altitude"), None);
    }

    #[test]
    fn the_zero_of_a_height_behind_its_unit_is_no_part_of_it() {
        assert_eq!(expression("ft msl").as_deref(), Some("ft"));
        assert_eq!(expression("level"), None);
    }
}
