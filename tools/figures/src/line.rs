//! Simplification and clipping of lines.

/// Point in the axes' own measures.
pub type Point = (f64, f64);

/// Largest distance of an omitted point from the line, page pixels: less than the width of a line.
const TOLERANCE: f64 = 0.3;

/// Simplifies a line by the algorithm of Douglas & Peucker (1973). `unit` is a page pixel in the
/// measure of each axis.
pub fn simplified(points: Vec<Point>, unit: [f64; 2]) -> Vec<Point> {
    let place = |k: usize| [points[k].0 / unit[0], points[k].1 / unit[1]];
    let mut kept = vec![false; points.len()];
    let mut open = Vec::new();
    if let Some(last) = points.len().checked_sub(1) {
        (kept[0], kept[last]) = (true, true);
        open.push((0, last));
    }
    while let Some((from, to)) = open.pop() {
        let ends = [place(from), place(to)];
        let far = (from + 1..to)
            .map(|k| (k, distance(place(k), ends)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((k, distance)) = far
            && distance > TOLERANCE
        {
            kept[k] = true;
            open.extend([(from, k), (k, to)]);
        }
    }
    let mut kept = kept.into_iter();
    points.into_iter().filter(|_| kept.next().unwrap_or(false)).collect()
}

/// Returns the distance from a point to the segment between two others.
fn distance(point: [f64; 2], [from, to]: [[f64; 2]; 2]) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let there = [point[0] - from[0], point[1] - from[1]];
    let length = along[0] * along[0] + along[1] * along[1];
    let part =
        if length > 0.0 { (along[0] * there[0] + along[1] * there[1]) / length } else { 0.0 };
    let part = part.clamp(0.0, 1.0);
    (there[0] - part * along[0]).hypot(there[1] - part * along[1])
}

/// Returns the pieces of a line between two heights.
pub fn clipped(points: &[Point], [low, high]: [f64; 2]) -> Vec<Vec<Point>> {
    let mut pieces = vec![Vec::new()];
    for (k, p) in points.iter().enumerate() {
        let crossed = k.checked_sub(1).into_iter().flat_map(|before| {
            let a = points[before];
            // in the order of crossing
            let limits = if a.1 < p.1 { [low, high] } else { [high, low] };
            let at = move |l: f64| (a.0 + (p.0 - a.0) * (l - a.1) / (p.1 - a.1), l);
            limits.into_iter().filter(move |l| (a.1 - l) * (p.1 - l) < 0.0).map(at)
        });
        let piece = pieces.len() - 1;
        pieces[piece].extend(crossed);
        if (low..=high).contains(&p.1) {
            pieces[piece].push(*p);
        } else {
            pieces.push(Vec::new());
        }
    }
    pieces.retain(|p| !p.is_empty());
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simplified_line_is_nowhere_further_from_its_points_than_the_tolerance() {
        let points: Vec<Point> = (0..1000)
            .map(f64::from)
            .map(|x| (x, 40.0 * (x / 60.0).sin() + (x * 7.3).sin()))
            .collect();
        let line = simplified(points.clone(), [2.0, 0.5]);
        let place = |p: &Point| [p.0 / 2.0, p.1 / 0.5];
        for p in &points {
            let nearest = line.windows(2).map(|w| distance(place(p), [place(&w[0]), place(&w[1])]));
            assert!(nearest.fold(f64::INFINITY, f64::min) <= TOLERANCE);
        }
        assert_eq!((line[0], line[line.len() - 1]), (points[0], points[999]));
        let straight = (0..1000).map(|k| (f64::from(k), 3.0 * f64::from(k))).collect();
        assert_eq!(simplified(straight, [1.0, 1.0]), [(0.0, 0.0), (999.0, 2997.0)]);
    }

    #[test]
    fn a_line_that_leaves_its_limits_ends_on_them_and_comes_back_from_them() {
        let line = [(0.0, 0.0), (1.0, 2.0), (2.0, 0.0), (3.0, -2.0), (4.0, 2.0)];
        let pieces = clipped(&line, [-1.0, 1.0]);
        assert_eq!(pieces[0], [(0.0, 0.0), (0.5, 1.0)]);
        assert_eq!(pieces[1], [(1.5, 1.0), (2.0, 0.0), (2.5, -1.0)]);
        assert_eq!(
            pieces[2],
            [(3.25, -1.0), (3.75, 1.0)],
            "through both limits from one point to the next"
        );
        assert_eq!(pieces.len(), 3);
    }
}
