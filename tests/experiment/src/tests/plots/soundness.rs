//! Any data gives a sound picture.

use crate::plot::{Axis, Chart, Colour, figure};
use proptest::{
    prelude::*,
    test_runner::{Config, RngSeed, TestRunner},
};

use crate::tests::fixtures::{
    charts::{axis, panel, series},
    picture::Picture,
};

#[test]
fn charts_without_data_are_empty() {
    let empty = |min: f64, max: f64| {
        vec![
            Chart::Scatter {
                x: axis("x", min, max),
                y: axis("y", min, max),
                series: Vec::new(),
            },
            Chart::Strips {
                x: axis("x", min, max),
                series: Vec::new(),
            },
            Chart::Histogram {
                label: "x".to_owned(),
                start: min,
                width: max - min,
                series: Vec::new(),
            },
            Chart::StackedBars {
                label: "x".to_owned(),
                rows: Vec::new(),
                series: Vec::new(),
            },
            Chart::GroupedBars {
                label: "x".to_owned(),
                groups: Vec::new(),
                series: Vec::new(),
            },
        ]
    };
    for (min, max) in [
        (0.0, 1.0),
        (3.0, 3.0),
        (0.0, 0.0),
        (2.0, 1.0),
        (f64::NAN, 1.0),
        (0.0, f64::INFINITY),
    ] {
        for chart in empty(min, max) {
            let picture = Picture::read(&figure("", &[panel("", chart.clone())], 1));
            assert!(picture.dots.is_empty() && picture.bars.is_empty(), "{chart:?}");
            assert!(!picture.points.is_empty(), "it has axes");
            picture.assert_all_inside();
        }
    }
    Picture::read(&figure("", &[], 0)).assert_all_inside();
}

/// Numbers of every kind, many of them ordinary.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![2 => -100.0..100.0, 1 => any::<f64>(), 1 => Just(0.0), 1 => Just(f64::NAN), 1 => Just(f64::MAX)]
}

fn numbers() -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(number(), 0..8)
}

fn any_axis() -> impl Strategy<Value = Axis> {
    (".{0,12}", number(), number()).prop_map(|(label, min, max)| Axis { label, min, max })
}

fn any_chart() -> impl Strategy<Value = Chart> {
    let colour = Colour(1, 2, 3);
    let list = move || proptest::collection::vec((".{0,12}", numbers()), 0..4);
    let named = move |list: Vec<(String, Vec<f64>)>| {
        list.into_iter()
            .map(|(name, values)| series(&name, colour, values))
            .collect::<Vec<_>>()
    };
    let texts = || proptest::collection::vec(".{0,12}", 0..5);
    prop_oneof![
        (any_axis(), any_axis(), list()).prop_map(move |(x, y, list)| Chart::Scatter {
            x,
            y,
            series: list
                .into_iter()
                .map(|(name, values)| series(
                    &name,
                    colour,
                    values.iter().copied().zip(values.iter().rev().copied()).collect()
                ))
                .collect(),
        }),
        (any_axis(), list()).prop_map(move |(x, list)| Chart::Strips {
            x,
            series: named(list)
        }),
        (
            number(),
            number(),
            proptest::collection::vec(proptest::collection::vec(any::<u64>(), 0..9), 0..4)
        )
            .prop_map(move |(start, width, counts)| Chart::Histogram {
                label: "x".to_owned(),
                start,
                width,
                series: counts
                    .into_iter()
                    .map(|counts| series("s", colour, counts))
                    .collect(),
            }),
        (texts(), list()).prop_map(move |(rows, list)| Chart::StackedBars {
            label: "x".to_owned(),
            rows,
            series: named(list)
        }),
        (texts(), list()).prop_map(move |(groups, list)| Chart::GroupedBars {
            label: "y".to_owned(),
            groups,
            series: named(list)
        }),
    ]
}

#[test]
fn any_numbers_give_a_sound_picture() {
    let config = Config {
        cases: 1000,
        rng_seed: RngSeed::Fixed(20_180_901),
        failure_persistence: None,
        ..Config::default()
    };
    let outcome = TestRunner::new(config).run(&(any_chart(), 0..7_usize), |(chart, columns)| {
        let panels = vec![panel("p", chart); columns + 1];
        let picture = Picture::read(&figure("t", &panels, columns));
        let dots = picture.dots.iter().map(|dot| (dot.x, dot.y));
        let bars = picture
            .bars
            .iter()
            .flat_map(|bar| [(bar.left, bar.top), (bar.right(), bar.bottom())]);
        for (x, y) in dots.chain(bars).chain(picture.points.iter().copied()) {
            prop_assert!(
                (0.0..=picture.width).contains(&x) && (0.0..=picture.height).contains(&y),
                "({x}, {y})"
            );
        }
        Ok(())
    });
    if let Err(error) = outcome {
        panic!("{error}");
    }
}
