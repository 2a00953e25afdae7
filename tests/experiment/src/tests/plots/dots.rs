//! Dots lie at their values.

use crate::plot::Chart;

use crate::tests::fixtures::charts::{
    BLUE, GREEN, RED, ROUNDING, assert_near, axis, line, picture_of, scattered, series,
};

#[test]
fn dots_lie_at_their_values_on_both_axes() {
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
fn dots_on_one_pixel_are_drawn_once_per_colour() {
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
fn only_finite_dots_beyond_the_axes_are_counted() {
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
fn strips_contain_their_values_and_widen_with_density() {
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
    // Each dot is one of the values, nearer to its own strip's name than to the other's.
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
