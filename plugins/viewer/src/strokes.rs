//! Text as strokes, for the map: the viewer draws no labels there.

/// A point of a stroke: to the right and upwards.
type Point = [f64; 2];

/// Distance between the left edges of two letters, and height of a letter, in the grid of the glyphs.
const ADVANCE: f64 = 3.0;
const HEIGHT: f64 = 4.0;

/// The strokes of a letter, on a grid 2 wide and 4 high; none for a letter that is not known.
fn glyph(letter: char) -> &'static [&'static [Point]] {
    match letter {
        '0' => &[&[[0., 0.], [2., 0.], [2., 4.], [0., 4.], [0., 0.]]],
        '1' => &[&[[1., 0.], [1., 4.], [0., 3.]]],
        '2' => &[&[[0., 4.], [2., 4.], [2., 2.], [0., 2.], [0., 0.], [2., 0.]]],
        '3' => &[&[[0., 4.], [2., 4.], [2., 0.], [0., 0.]], &[[0., 2.], [2., 2.]]],
        '4' => &[&[[0., 4.], [0., 2.], [2., 2.]], &[[2., 4.], [2., 0.]]],
        '5' | 'S' => &[&[[2., 4.], [0., 4.], [0., 2.], [2., 2.], [2., 0.], [0., 0.]]],
        '6' => &[&[[2., 4.], [0., 4.], [0., 0.], [2., 0.], [2., 2.], [0., 2.]]],
        '7' => &[&[[0., 4.], [2., 4.], [1., 0.]]],
        '8' => &[&[[0., 0.], [2., 0.], [2., 4.], [0., 4.], [0., 0.]], &[[0., 2.], [2., 2.]]],
        '9' => &[&[[2., 2.], [0., 2.], [0., 4.], [2., 4.], [2., 0.], [0., 0.]]],
        '°' => &[&[[0., 3.], [1., 3.], [1., 4.], [0., 4.], [0., 3.]]],
        '\'' => &[&[[1., 4.], [1., 3.]]],
        '.' => &[&[[1., 0.], [1., 0.5]]],
        'N' => &[&[[0., 0.], [0., 4.], [2., 0.], [2., 4.]]],
        'E' => &[&[[2., 4.], [0., 4.], [0., 0.], [2., 0.]], &[[0., 2.], [1.5, 2.]]],
        'W' => &[&[[0., 4.], [0.5, 0.], [1., 2.5], [1.5, 0.], [2., 4.]]],
        'm' => &[&[[0., 0.], [0., 2.5], [2., 2.5], [2., 0.]], &[[1., 0.], [1., 2.5]]],
        'k' => &[&[[0., 0.], [0., 4.]], &[[2., 2.5], [0., 1.2], [2., 0.]]],
        _ => &[],
    }
}

/// The strokes of a text of that height, right and up from its lower left corner.
pub fn strokes(text: &str, height: f64) -> Vec<Vec<Point>> {
    let size = height / HEIGHT;
    let at = |place: usize, [x, y]: Point| [size * (ADVANCE * place as f64 + x), size * y];
    let letters = text.chars().enumerate();
    let all = letters.flat_map(|(k, letter)| {
        glyph(letter).iter().map(move |stroke| stroke.iter().map(|p| at(k, *p)).collect())
    });
    all.collect()
}

/// The width of a text of that height.
pub fn width(text: &str, height: f64) -> f64 {
    height / HEIGHT * (ADVANCE * text.chars().count() as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_letter_of_an_angle_and_a_distance_has_strokes_inside_its_box() {
        for text in ["0123456789", "43°06.2'N", "5°22.5'W", "12'SE", "20km"] {
            let strokes = strokes(text, 8.0);
            let points = || strokes.iter().flatten();
            let inside =
                |[x, y]: &Point| (0.0..=width(text, 8.0)).contains(x) && (0.0..=8.0).contains(y);
            assert!(points().all(inside), "{text}");
            for k in 0..text.chars().count() {
                let of = |[x, _]: &&Point| (6.0 * k as f64..6.0 * (k + 1) as f64).contains(x);
                assert!(points().any(|p| of(&p)), "{text}, letter {k}");
            }
        }
    }
}
