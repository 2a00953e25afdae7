//! Each kind of chart shows its data.

use grasp_experiment::plot::{Chart, Colour};

use crate::{axis, picture_of, scattered, series, strings};

const RED: Colour = Colour(200, 0, 0);
const GREEN: Colour = Colour(0, 200, 0);
const BLUE: Colour = Colour(0, 0, 200);

/// What rounding to the picture's units may move a dot or an edge by.
const ROUNDING: f64 = 1.5;

/// The line through two points, as a function.
fn line((x0, y0): (f64, f64), (x1, y1): (f64, f64)) -> impl Fn(f64) -> f64 {
    move |x| y0 + (x - x0) * (y1 - y0) / (x1 - x0)
}

fn assert_near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= ROUNDING,
        "{found} instead of {expected}"
    );
}

#[test]
fn dots_lie_where_the_axes_say() {
    // The first two dots are the corners.
    let mut dots = vec![(-5.0, 20.0), (15.0, 520.0)];
    dots.extend(
        scattered(200, 1.0)
            .into_iter()
            .zip(scattered(200, 1.7))
            .map(|(x, y)| (-5.0 + 20.0 * x, 20.0 + 500.0 * y)),
    );
    let picture = picture_of(Chart::Scatter {
        x: axis("x", -5.0, 15.0),
        y: axis("y", 20.0, 520.0),
        series: vec![series("dots", RED, dots.clone())],
    });
    assert_eq!(picture.dots.len(), dots.len());
    let (first, second) = (picture.dots[0], picture.dots[1]);
    let across = line((-5.0, first.x), (15.0, second.x));
    let up = line((20.0, first.y), (520.0, second.y));
    assert!(
        second.x - first.x > 5000.0 && first.y - second.y > 2000.0,
        "the corners are far apart"
    );
    for (dot, (x, y)) in picture.dots.iter().zip(&dots) {
        assert_near(dot.x, across(*x));
        assert_near(dot.y, up(*y));
    }
    // The ticks of both axes agree with the dots.
    assert_near(picture.find("10").x, across(10.0));
    assert_near(picture.find("−2").x, across(-2.0));
    assert_near(picture.find("100").y, up(100.0));
    assert_near(picture.find("500").y, up(500.0));
}

#[test]
fn dots_on_the_same_pixel_are_drawn_once_for_each_colour() {
    let near = vec![(0.5, 0.5); 100];
    let chart = |dots: Vec<(f64, f64)>| Chart::Scatter {
        x: axis("x", 0.0, 1.0),
        y: axis("y", 0.0, 1.0),
        series: vec![series("red", RED, dots), series("green", GREEN, vec![(0.5, 0.5)])],
    };
    let colours: Vec<_> = picture_of(chart(near))
        .dots
        .iter()
        .map(|dot| dot.colour)
        .collect();
    assert_eq!(colours, [RED, GREEN], "in the order of the series");
    // A hundredth of the plot is several pixels.
    assert_eq!(
        picture_of(chart(vec![(0.5, 0.5), (0.51, 0.5), (0.5, 0.51)]))
            .dots_of(RED)
            .len(),
        3
    );
}

#[test]
fn dots_beyond_the_axes_are_counted_and_those_that_are_not_finite_are_not() {
    let picture = picture_of(Chart::Scatter {
        x: axis("x", 0.0, 1.0),
        y: axis("y", 0.0, 1.0),
        series: vec![series(
            "dots",
            RED,
            vec![
                (0.0, 1.0),
                (1.1, 0.5),
                (0.5, -1e300),
                (f64::NAN, 0.5),
                (0.5, f64::INFINITY),
                (1.0, 0.0),
            ],
        )],
    });
    assert_eq!(picture.dots.len(), 2);
    picture.find("2 beyond the axes");
}

#[test]
fn strips_hold_their_values_and_are_wider_where_there_are_more() {
    let dense: Vec<_> = scattered(400, 1.0)
        .iter()
        .map(|value| 10.0 + 10.0 * value)
        .collect();
    let sparse: Vec<_> = scattered(20, 1.0)
        .iter()
        .map(|value| 60.0 + 30.0 * value)
        .collect();
    let mut first = vec![0.0, 100.0];
    first.extend(dense.iter().chain(&sparse));
    let picture = picture_of(Chart::Strips {
        x: axis("x", 0.0, 100.0),
        series: vec![
            series("NoThumbEarlyStop", RED, first.clone()),
            series("Valid", BLUE, vec![50.0, f64::NAN, 25.0]),
        ],
    });
    picture.find("n = 422");
    picture.find("n = 2");
    let (upper, lower) = (picture.find("NoThumbEarlyStop").y, picture.find("Valid").y);
    assert!(upper < lower, "the first strip is on top");
    let reds = picture.dots_of(RED);
    let across = line((0.0, reds[0].x), (100.0, reds[1].x));
    // Each dot is one of the values, and stays nearer to its own strip's name than to the other's.
    for dot in &reds {
        assert!(
            first
                .iter()
                .any(|value| (across(*value) - dot.x).abs() <= ROUNDING),
            "{dot:?}"
        );
        assert!((dot.y - upper).abs() < 0.5 * (lower - upper), "{dot:?}");
    }
    for (dot, value) in picture.dots_of(BLUE).iter().zip([50.0, 25.0]) {
        assert_near(dot.x, across(value));
        assert_near(dot.y, lower);
    }
    let spread = |from: f64, to: f64| {
        let inside = reds
            .iter()
            .filter(|dot| (across(from)..across(to)).contains(&dot.x));
        inside.map(|dot| (dot.y - upper).abs()).fold(0.0, f64::max)
    };
    assert!(
        spread(10.0, 20.0) > 3.0 * spread(60.0, 90.0),
        "{} and {}",
        spread(10.0, 20.0),
        spread(60.0, 90.0)
    );
}

#[test]
fn histograms_stack_bars_as_high_as_their_counts() {
    let counts = [[3_u64, 0, 40, 7], [5, 9, 0, 100], [1, 2, 30, 0]];
    let colours = [RED, GREEN, BLUE];
    let picture = picture_of(Chart::Histogram {
        label: "Bend angle (°)".to_owned(),
        start: -50.0,
        width: 10.0,
        series: (0..3)
            .map(|place| series(["r", "g", "b"][place], colours[place], counts[place].to_vec()))
            .collect(),
    });
    let across = line((-50.0, picture.find("−50").x), (-10.0, picture.find("−10").x));
    let ground = picture.find("0").y;
    let unit = (ground - picture.find("100").y) / 100.0;
    let mut drawn = 0;
    for bin in 0..4 {
        let mut foot = None;
        let (left, right) = (
            across(-50.0 + 10.0 * bin as f64),
            across(-40.0 + 10.0 * bin as f64),
        );
        for (place, colour) in colours.into_iter().enumerate() {
            let bars = picture.bars_of(colour);
            let bar = bars
                .iter()
                .find(|bar| bar.left >= left - ROUNDING && bar.right() <= right + ROUNDING);
            let count = counts[place][bin];
            assert_eq!(bar.is_some(), count > 0, "bin {bin} of series {place}");
            if let Some(bar) = bar {
                match foot {
                    None => assert_near(bar.bottom(), ground),
                    Some(foot) => assert_eq!(bar.bottom(), foot, "no gap in bin {bin}"),
                }
                assert_near(bar.height, unit * count as f64);
                foot = Some(bar.top);
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, picture.bars.len());
}

#[test]
fn stacked_bars_are_as_long_as_their_values() {
    let values = [[720.0, 0.0, 1.0], [420.0, 1100.0, f64::NAN], [360.0, 12.5, -7.0]];
    let colours = [RED, GREEN, BLUE];
    let picture = picture_of(Chart::StackedBars {
        label: "Time (µs)".to_owned(),
        rows: strings(&["A", "B", "C"]),
        series: (0..3)
            .map(|place| series(["r", "g", "b"][place], colours[place], values[place].to_vec()))
            .collect(),
    });
    let across = line(
        (
            0.0,
            picture.words.iter().find(|words| words.text == "0").unwrap().x,
        ),
        (1000.0, picture.find("1,000").x),
    );
    let names = ["A", "B", "C"].map(|name| picture.find(name).y);
    assert!(names.is_sorted(), "from the top");
    let mut drawn = 0;
    for (row, middle) in names.into_iter().enumerate() {
        let mut from = 0.0;
        let mut edge = across(0.0);
        for (place, colour) in colours.into_iter().enumerate() {
            let value = values[place][row];
            let bars = picture.bars_of(colour);
            let bar = bars.iter().find(|bar| (bar.top..bar.bottom()).contains(&middle));
            assert_eq!(bar.is_some(), value > 0.0, "row {row} of series {place}");
            if let Some(bar) = bar {
                assert!((bar.left - edge).abs() <= ROUNDING, "no gap in row {row}");
                from += value;
                assert_near(bar.right(), across(from));
                edge = bar.right();
                drawn += 1;
            }
        }
    }
    assert_eq!(drawn, picture.bars.len());
    // Values stand in parts that have the room, sums behind bars of different lengths.
    picture.find("1,100");
    picture.find("1,500");
    assert!(
        !picture.texts().contains(&"13"),
        "12.5 has no room: {:?}",
        picture.texts()
    );
}

#[test]
fn grouped_bars_are_as_high_as_their_logarithms() {
    let thesis = [700_000.0, 1234.0, f64::NAN, 0.0];
    let here = [0.05, 20.0, 52.0, -3.0];
    let picture = picture_of(Chart::GroupedBars {
        label: "ms".to_owned(),
        groups: strings(&["A", "B", "C", "D"]),
        series: vec![
            series("Thesis", RED, thesis.to_vec()),
            series("Here", BLUE, here.to_vec()),
        ],
    });
    let up = line((0.0, picture.find("1").y), (4.0, picture.find("10,000").y));
    let (reds, blues) = (picture.bars_of(RED), picture.bars_of(BLUE));
    assert_eq!(
        (reds.len(), blues.len()),
        (2, 3),
        "no bar for what is missing or has no logarithm"
    );
    for (bars, values) in [(&reds, &thesis), (&blues, &here)] {
        for (bar, value) in bars.iter().zip(values) {
            assert_near(bar.top, up(value.log10()));
            assert_eq!(bar.bottom(), reds[0].bottom());
        }
    }
    // The bars of a group touch each other in the series' order, around the group's name.
    for (group, (red, blue)) in reds.iter().zip(&blues).enumerate() {
        assert!((red.right() - blue.left).abs() <= ROUNDING);
        assert_near(picture.find(["A", "B"][group]).x, red.right());
    }
    assert!(
        reds[0].height > 0.0 && blues[0].height > 0.0,
        "even the lowest bar can be seen"
    );
    for value in ["700,000", "1,234", "0.05", "20", "52"] {
        picture.find(value);
    }
}

#[test]
fn values_are_written_upright_over_narrow_bars_inside_the_picture() {
    let groups: Vec<_> = (0..15).map(|group| format!("Remote GenHold{group}")).collect();
    let values: Vec<_> = (0..15).map(|group| 456_287.0 * f64::from(group + 1)).collect();
    let picture = picture_of(Chart::GroupedBars {
        label: "Attempts".to_owned(),
        groups,
        series: vec![
            series("Thesis", RED, values.clone()),
            series("Here", BLUE, values),
        ],
    });
    let words: Vec<_> = picture
        .words
        .iter()
        .filter(|words| words.text == "456,287")
        .collect();
    assert_eq!(words.len(), 2);
    assert!(
        words
            .iter()
            .all(|words| words.upright.end - words.upright.start > words.across.end - words.across.start)
    );
    picture.assert_all_inside();
}
