//! The class of an IMU.

/// Noise of the gyros of each class, deg/h/sqrt(Hz), as the key `grade` has it.
const CLASSES: [(&str, f64); 3] = [("navigation", 0.1), ("tactical", 3.0), ("mems", 18.0)];

/// The line with the class by the noise of the gyros, and what to ask about it. The vibration of a
/// vehicle that moves makes any class but the best one worse than it is; its wide errors would hide
/// what the samples show of other sensors, so the line is then a comment.
pub(super) fn line(noise: f64, steady: bool) -> (String, Option<&'static str>) {
    let class = of_noise(noise);
    let line = format!("grade = \"{class}\"");
    if steady || class == CLASSES[0].0 {
        return (line, Some("class by its noise, for scale factors and axes"));
    }
    (format!("# {line}    # the class of the data sheet adds scale factors and axes"), None)
}

/// The class whose gyros have the noise that is nearest by its ratio.
fn of_noise(noise: f64) -> &'static str {
    let far = |class: &(&str, f64)| (noise / class.1).ln().abs();
    let nearest = CLASSES.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
    nearest.map_or("mems", |(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::of_noise;

    /// The limits are the geometric means: 0.55 and 7.3.
    #[test]
    fn the_class_is_the_nearest_by_the_ratio_of_noise() {
        for (noise, class) in [
            (0.02, "navigation"),
            (0.54, "navigation"),
            (0.56, "tactical"),
            (7.2, "tactical"),
            (7.5, "mems"),
            (200.0, "mems"),
        ] {
            assert_eq!(of_noise(noise), class, "{noise}");
        }
    }
}
