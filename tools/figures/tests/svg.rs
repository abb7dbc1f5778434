//! Every figure gives a valid picture, and the picture shows the content of the figure.

#![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

use navfuse_figures::{Axis, Band, Curve, Figure, Look, Panel, Scale, svg};
use proptest::prelude::*;
use roxmltree::Document;

const BLUE: &str = "#0072B2";

fn figure(columns: usize, panels: Vec<Panel>) -> Figure {
    Figure { name: "f".into(), title: "A < title > & \"more\"".into(), columns, panels }
}

fn panel(y: Axis, curves: Vec<Curve>, bands: Vec<Band>) -> Panel {
    Panel { title: "panel".into(), x: Axis::time(), y, curves, bands }
}

fn curve(name: &str, look: Look, values: &[f64]) -> Curve {
    let points = values.iter().enumerate().map(|(k, v)| [k as f64, *v]).collect();
    Curve { name: name.into(), look, points }
}

fn texts(picture: &str) -> Vec<String> {
    let document = Document::parse(picture).unwrap();
    let texts = document.descendants().filter(|n| n.has_tag_name("text"));
    texts.map(|n| n.text().unwrap_or_default().trim().to_owned()).collect()
}

/// Returns the vertices of each line of a colour, without the first line, the sample in the legend.
fn lines(picture: &str, colour: &str) -> Vec<Vec<[f64; 2]>> {
    let document = Document::parse(picture).unwrap();
    let point = |p: &str| -> [f64; 2] {
        let (x, y) = p.split_once(',').unwrap();
        [x.parse().unwrap(), y.parse().unwrap()]
    };
    (document.descendants())
        .filter(|n| n.has_tag_name("polyline") && n.attribute("stroke") == Some(colour))
        .map(|n| n.attribute("points").unwrap().split_whitespace().map(point).collect::<Vec<_>>())
        .skip(1)
        .collect()
}

fn dots(picture: &str, colour: &str) -> usize {
    let document = Document::parse(picture).unwrap();
    (document.descendants())
        .filter(|n| n.has_tag_name("path") && n.attribute("stroke") == Some(colour))
        .map(|n| n.attribute("d").unwrap().matches("h0").count())
        .sum()
}

#[test]
fn a_panel_without_data_shows_no_data() {
    let nan = f64::NAN;
    for values in [&[][..], &[nan], &[nan, nan, nan], &[f64::INFINITY, f64::NEG_INFINITY]] {
        let picture = svg(&figure(
            1,
            vec![panel(Axis::linear("y"), vec![curve("c", Look::Data(0), values)], vec![])],
        ));
        assert!(texts(&picture.unwrap()).contains(&"no data".into()), "{values:?}");
    }
    let negative =
        panel(Axis::logarithmic("y"), vec![curve("c", Look::Data(0), &[0.0, -1.0, -2.0])], vec![]);
    assert!(texts(&svg(&figure(1, vec![negative])).unwrap()).contains(&"no data".into()));
    assert!(texts(&svg(&figure(0, vec![])).unwrap()).contains(&"no data".into()));
}

#[test]
fn a_constant_a_single_point_and_a_title_of_markup_are_drawn() {
    for values in [
        &[7.0][..],
        &[7.0, 7.0, 7.0],
        &[0.0, 0.0, 0.0],
        &[1e-300, 2e-300, 1e-300],
        &[-3e99, 3e99, 0.0],
    ] {
        for y in [Axis::linear("y"), Axis::logarithmic("y")] {
            let picture =
                svg(&figure(3, vec![panel(y, vec![curve("c", Look::Data(0), values)], vec![])]))
                    .unwrap();
            let texts = texts(&picture);
            assert!(texts.contains(&"A < title > & \"more\"".into()), "{texts:?}");
            let seen = lines(&picture, BLUE).len() + dots(&picture, BLUE);
            assert!(seen > 0 || texts.contains(&"no data".into()), "{values:?}");
        }
    }
}

#[test]
fn names_of_an_axis_stand_at_their_places_and_beyond_their_points() {
    let points = vec![[0.1, 1.0], [0.2, 3.0]];
    let methods = Curve { name: "estimate".into(), look: Look::Points(0), points };
    let y = Axis::of_names(["tang", "joyce", "io-dvlc"]);
    let picture = svg(&figure(1, vec![panel(y, vec![methods], vec![])])).unwrap();
    let texts = texts(&picture);
    let of = |name: &str| texts.iter().position(|text| text == name);
    assert!(of("tang").is_some() && of("joyce").is_some() && of("io-dvlc").is_some(), "{texts:?}");
    // with the sample of the legend
    assert_eq!(dots(&picture, BLUE), 3);
    let empty = panel(Axis::of_names(["tang"]), vec![], vec![]);
    let empty = svg(&figure(1, vec![empty])).unwrap();
    assert!(empty.contains("no data"));
}

#[test]
fn a_range_too_small_for_the_arithmetic_of_an_axis_is_one_of_zeros() {
    let curve = || curve("c", Look::Data(0), &[0.0, 1.0]);
    for least in [-3.063140057416345e-309, 4.9e-324, 2e-308, 1e-200, 1e-101] {
        let picture = svg(&figure(
            1,
            vec![panel(Axis::linear("y").within([0.0, least]), vec![curve()], vec![])],
        ))
        .unwrap();
        assert!(!picture.contains("NaN") && !picture.contains("inf"), "{least}");
    }
}

#[test]
fn every_name_title_and_label_is_written() {
    let looks =
        [Look::Data(0), Look::Data(1), Look::Sigma, Look::Bound, Look::Truth, Look::Points(2)];
    let names = ["error of x", "error of y", "sigma", "limit", "truth", "samples"];
    let curves: Vec<_> =
        looks.iter().zip(names).map(|(look, name)| curve(name, *look, &[1.0, 2.0, 3.0])).collect();
    let band = Band { name: "95 %".into(), points: vec![[0.0, 1.0, 2.0], [2.0, 1.0, 2.0]] };
    let other =
        panel(Axis::linear("z [m]"), vec![curve("something else", Look::Data(0), &[1.0])], vec![]);
    let one = panel(Axis::logarithmic("y [deg/h]"), curves, vec![band]);
    let texts = texts(&svg(&figure(2, vec![one, other])).unwrap());
    for text in
        names.iter().chain(&["something else", "95 %", "y [deg/h]", "z [m]", "time [s]", "panel"])
    {
        assert!(texts.iter().any(|t| t == text), "{text} is not in {texts:?}");
    }
}

#[test]
fn what_means_the_same_in_all_panels_is_explained_once() {
    let one = || panel(Axis::linear("y"), vec![curve("error", Look::Data(0), &[1.0, 2.0])], vec![]);
    let count =
        |panels| texts(&svg(&figure(2, panels)).unwrap()).iter().filter(|t| *t == "error").count();
    assert_eq!(count(vec![one(), one(), one()]), 1);
    // where the first colour means something else elsewhere, every panel has its own legend
    let other = panel(Axis::linear("y"), vec![curve("truth", Look::Data(0), &[1.0, 2.0])], vec![]);
    assert_eq!(count(vec![one(), other, one()]), 2);
}

#[test]
fn a_nan_breaks_the_line_and_a_point_between_two_of_them_is_still_seen() {
    let nan = f64::NAN;
    let values = [1.0, 3.0, 2.0, nan, 4.0, 5.0, 3.0, 4.0, nan, 2.0, nan];
    let picture = svg(&figure(
        1,
        vec![panel(Axis::linear("y"), vec![curve("c", Look::Data(0), &values)], vec![])],
    ));
    let picture = picture.unwrap();
    assert_eq!(lines(&picture, BLUE).iter().map(Vec::len).collect::<Vec<_>>(), [3, 4]);
    assert_eq!(dots(&picture, BLUE), 1);
}

/// A report of many sensors has ten thousand dots: each needs a place, and the look once for all.
#[test]
fn the_dots_of_a_curve_are_one_path_and_each_is_there() {
    let values: Vec<f64> = (0..500).map(|k| f64::from(k * 37 % 101)).collect();
    let points = panel(Axis::linear("y"), vec![curve("c", Look::Points(0), &values)], vec![]);
    let picture = svg(&figure(1, vec![points])).unwrap();
    // with the one in the legend
    assert_eq!(dots(&picture, BLUE), 501);
    assert_eq!(picture.matches("<circle").count(), 0);
    assert!(picture.matches("<path").count() <= 2, "{}", picture.matches("<path").count());
}

#[test]
fn decades_are_evenly_apart_on_a_logarithmic_axis_and_zero_breaks_the_line() {
    let values = [1e-3, 1e-2, 1e-3, 0.0, 1.0, 10.0, 1.0];
    let picture = svg(&figure(
        1,
        vec![panel(Axis::logarithmic("y"), vec![curve("c", Look::Data(0), &values)], vec![])],
    ));
    let lines = lines(&picture.unwrap(), BLUE);
    let steps: Vec<f64> =
        lines.iter().flat_map(|l| l.windows(2).map(|w| (w[0][1] - w[1][1]).abs())).collect();
    assert_eq!(steps.len(), 4);
    // each position is rounded to a unit: a difference of two is off by at most one, and a
    // difference of two differences by at most two
    assert!(steps.iter().all(|s| *s > 50.0 && (s - steps[0]).abs() <= 2.0), "{steps:?}");
}

#[test]
fn a_square_on_a_map_is_square_whatever_the_room() {
    for columns in [1, 2, 3] {
        let square = Curve {
            name: "track".into(),
            look: Look::Data(0),
            points: vec![[0.0, 0.0], [0.0, 400.0], [400.0, 400.0], [400.0, 0.0]],
        };
        let map = Panel {
            title: String::new(),
            x: Axis::map("east [m]"),
            y: Axis::map("north [m]"),
            curves: vec![square],
            bands: vec![],
        };
        let picture = svg(&figure(columns, vec![map; columns])).unwrap();
        for line in lines(&picture, BLUE).iter().filter(|l| l.len() == 4) {
            let (wide, high) = (line[2][0] - line[1][0], line[0][1] - line[1][1]);
            // to a unit of the drawing at each end
            assert!(
                wide > 100.0 && (wide - high).abs() <= 2.0,
                "{columns} columns: {wide} by {high}"
            );
        }
    }
}

#[test]
fn what_is_beyond_the_limits_of_an_axis_is_cut_off() {
    let values: Vec<f64> = (0..200).map(|k| f64::from(k) - 100.0).collect();
    let picture = |y: Axis| {
        svg(&figure(1, vec![panel(y, vec![curve("c", Look::Data(0), &values)], vec![])])).unwrap()
    };
    let (whole, within) =
        (picture(Axis::linear("y")), picture(Axis::linear("y").within([-10.0, 30.0])));
    let (whole, within) = (&lines(&whole, BLUE)[0], &lines(&within, BLUE)[0]);
    let extent = |line: &[[f64; 2]], k: usize| (line[line.len() - 1][k] - line[0][k]).abs();
    // a fifth of the values fills the height; all values fill it except for a margin of 5 % at each
    // end
    assert!((extent(within, 0) / extent(whole, 0) - 40.0 / 199.0).abs() < 0.01);
    assert!((extent(within, 1) / extent(whole, 1) - 1.1).abs() < 0.01);
}

#[test]
fn a_line_there_and_back_on_one_level_keeps_its_ends() {
    let points =
        vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [9.0, 0.0], [-5.0, 0.0], [1.0, 0.0], [1.0, 1.0]];
    let line = Curve { name: "c".into(), look: Look::Data(0), points };
    let picture = svg(&figure(1, vec![panel(Axis::linear("y"), vec![line], vec![])])).unwrap();
    let lines = lines(&picture, BLUE);
    // the ends at 0, 9, -5 and 1, and the last point
    assert_eq!(lines[0].len(), 5);
    let [a, b, c] = [0, 1, 2].map(|k| lines[0][k][0]);
    // 0 to 9 and 9 to -5, each place rounded to a unit
    assert!(((b - a) / 9.0 - (b - c) / 14.0).abs() < 1.0 / 9.0 + 1.0 / 14.0, "{lines:?}");
}

#[test]
fn a_figure_of_19_states_is_small_enough_for_a_page() {
    let values = |k: usize| (0..300).map(|i| ((i * i + k) as f64).sin()).collect::<Vec<_>>();
    let lines = [Look::Data(0), Look::Truth, Look::Sigma, Look::Sigma, Look::Bound];
    for looks in [&lines[..], &[Look::Points(0), Look::Sigma, Look::Bound]] {
        let panels = (0..19).map(|k| {
            let curves = looks.iter().map(|look| curve("c", *look, &values(k))).collect();
            let points = (0..300).map(|i| [f64::from(i), -1.0, 1.0]).collect();
            panel(Axis::linear("y"), curves, vec![Band { name: "b".into(), points }])
        });
        let picture = svg(&figure(4, panels.collect())).unwrap();
        assert!(picture.len() < 500_000, "{} bytes", picture.len());
    }
}

fn value() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -10.0..10.0,
        2 => proptest::num::f64::ANY,
        1 => Just(f64::NAN),
        1 => Just(0.0),
        2 => 1e-12..1e12
    ]
}

/// Text of at most so many characters, which cannot spell `NaN` or `inf`.
fn text(longest: usize) -> impl Strategy<Value = String> {
    proptest::string::string_regex(&format!("[^Nf\\n]{{0,{longest}}}")).unwrap()
}

fn axis() -> impl Strategy<Value = Axis> {
    let scale = prop_oneof![
        Just(Scale::Linear),
        Just(Scale::Logarithmic),
        Just(Scale::Time),
        Just(Scale::Map)
    ];
    (text(40), scale, proptest::option::of([value(), value()]))
        .prop_map(|(label, scale, limits)| Axis { label, scale, limits, names: Vec::new() })
}

fn look() -> impl Strategy<Value = Look> {
    let index = any::<usize>();
    prop_oneof![
        index.prop_map(Look::Data),
        index.prop_map(Look::Points),
        Just(Look::Sigma),
        Just(Look::Bound),
        Just(Look::Truth)
    ]
}

fn any_panel() -> impl Strategy<Value = Panel> {
    let curve = (text(60), look(), prop::collection::vec([value(), value()], 0..12))
        .prop_map(|(name, look, points)| Curve { name, look, points });
    let band = (text(20), prop::collection::vec([value(), value(), value()], 0..12))
        .prop_map(|(name, points)| Band { name, points });
    let (curves, bands) = (prop::collection::vec(curve, 0..4), prop::collection::vec(band, 0..3));
    (text(80), axis(), axis(), curves, bands).prop_map(|(title, x, y, curves, bands)| Panel {
        title,
        x,
        y,
        curves,
        bands,
    })
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 256,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_figure_is_a_picture_and_the_same_one_each_time(
        columns in 0usize..6,
        title in text(200),
        panels in prop::collection::vec(any_panel(), 0..7),
    ) {
        let figure = Figure { name: "f".into(), title, columns, panels };
        let picture = svg(&figure).unwrap();
        prop_assert_eq!(&picture, &svg(&figure.clone()).unwrap());
        let document = Document::parse(&picture).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert!(!picture.contains("NaN") && !picture.contains("inf"), "numbers are numbers");
        // nothing is drawn outside: all vertices lie in the picture
        let of = |name: &str| document.root_element().attribute("viewBox").unwrap().split(' ')
            .nth(usize::from(name == "height") + 2).unwrap().parse::<f64>().unwrap();
        let (wide, high) = (of("width"), of("height"));
        let points = document.descendants().filter_map(|n| n.attribute("points"));
        for line in points.flat_map(str::split_whitespace) {
            let (x, y) = line.split_once(',').unwrap();
            let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
            prop_assert!((0.0..=wide).contains(&x) && (0.0..=high).contains(&y), "{}", line);
        }
    }
}

#[test]
fn the_description_of_a_plot_gives_the_values_of_its_points_back() {
    // a logarithmic axis, and a name that JSON and XML both escape
    let name = "a \"b\" <c> \\";
    let values = [0.01, 3.0, 250.0, 0.5];
    let curves = vec![curve(name, Look::Data(0), &values)];
    let band = Band { name: "±3 sigma".into(), points: vec![[0.0, 0.1, 1.0], [3.0, 0.1, 1.0]] };
    let picture =
        svg(&figure(1, vec![panel(Axis::logarithmic("y [m]"), curves, vec![band])])).unwrap();
    let document = Document::parse(&picture).unwrap();
    let plots = document.root_element().attribute("data-plots").unwrap();
    let plots: serde_json::Value = serde_json::from_str(plots).unwrap();
    let plot = &plots[0];
    assert_eq!((plots.as_array().unwrap().len(), &plot["curves"][0]["name"]), (1, &name.into()));
    assert_eq!(
        (&plot["curves"][0]["colour"], &plot["bands"][0]),
        (&BLUE.into(), &"±3 sigma".into())
    );
    assert_eq!((&plot["y"]["label"], &plot["y"]["log"]), (&"y [m]".into(), &true.into()));
    let [left, top, wide, high] = [0, 1, 2, 3].map(|k| plot["at"][k].as_f64().unwrap());
    let range = |axis: &str| ["low", "high"].map(|end| plot[axis][end].as_f64().unwrap());
    let ([x0, x1], [y0, y1]) = (range("x"), range("y"));
    let line = &lines(&picture, BLUE)[0];
    assert_eq!(line.len(), values.len());
    for (k, ([px, py], value)) in line.iter().zip(values).enumerate() {
        let x = x0 + (px - left) / wide * (x1 - x0);
        let y = y1 - (py - top) / high * (y1 - y0);
        // coordinates are whole units: of the point, and of the corner of the plot
        let [dx, dy] = [(x1 - x0) / wide, (y1 - y0) / high];
        assert!((x - k as f64).abs() <= 1.5 * dx, "{x} {k}");
        assert!((y - f64::log10(value)).abs() <= 1.5 * dy, "{y} {value}");
    }
}
