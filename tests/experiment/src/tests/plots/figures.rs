//! Properties of all charts, and of grids of charts.

use crate::plot::{Chart, Panel, figure, palette};

use crate::tests::fixtures::{
    charts::{axis, panel, scattered, series, strings},
    picture::{Bar, Picture},
};

const KINDS: [&str; 8] = [
    "NoContacts",
    "NoThumb",
    "NoThumbEarlyStop",
    "NoFingers",
    "PalmCollision",
    "FingerCollision",
    "UnwantedContact",
    "NotImmobilizing",
];

/// A chart of each kind, similar to those of chapter 5.
fn charts() -> Vec<Chart> {
    let kinds = || KINDS.into_iter().zip(palette::REJECTIONS);
    let spread = |seed: f64| {
        scattered(300, seed)
            .into_iter()
            .map(|value| 180.0 * value)
            .collect::<Vec<_>>()
    };
    let pairs = |seed: f64| {
        spread(seed)
            .into_iter()
            .zip(spread(seed + 0.3))
            .collect::<Vec<_>>()
    };
    let ratios = ["Bend ratio 0.7", "Bend ratio 1", "Bend ratio 1.42"]
        .into_iter()
        .zip(palette::BEND_RATIOS);
    vec![
        Chart::Scatter {
            x: axis("Forward wrist angle (°)", 0.0, 180.0),
            y: axis("Upward wrist angle (°)", 0.0, 180.0),
            series: vec![
                series("NoContacts", palette::NO_CONTACTS, pairs(1.0)),
                series("Other rejections", palette::OTHER_REJECTIONS, pairs(1.1)),
                series("Valid", palette::VALID, pairs(1.2)),
            ],
        },
        Chart::Strips {
            x: axis("Wrist distance (cm)", 0.0, 180.0),
            series: kinds()
                .zip(1..)
                .map(|((name, colour), seed)| series(name, colour, spread(f64::from(seed))))
                .collect(),
        },
        Chart::Histogram {
            label: "Bend angle (°)".to_owned(),
            start: -20.0,
            width: 10.0,
            series: ratios
                .map(|(name, colour)| series(name, colour, (1..12).collect()))
                .collect(),
        },
        Chart::StackedBars {
            label: "Invalid grasps".to_owned(),
            rows: strings(&["A", "B", "C", "D", "E", "F"]),
            series: kinds()
                .map(|(name, colour)| series(name, colour, vec![1.0, 700.0, 1e3, 456_287.0, 0.0, 5e5]))
                .collect(),
        },
        Chart::GroupedBars {
            label: "Time (ms)".to_owned(),
            groups: strings(&["A", "B", "C", "D", "E", "F"]),
            series: vec![
                series(
                    "Thesis",
                    palette::THESIS,
                    vec![7e5, 456_287.0, 0.05, f64::NAN, 1.0, 3.0],
                ),
                series(
                    "Here",
                    palette::HERE,
                    vec![7e5, 456_287.0, 0.05, 12.5, 1.0, f64::INFINITY],
                ),
            ],
        },
    ]
}

fn names(chart: &Chart) -> Vec<&str> {
    fn of<T>(series: &[crate::plot::Series<T>]) -> Vec<&str> {
        series.iter().map(|series| series.name.as_str()).collect()
    }
    match chart {
        Chart::Scatter { series, .. } => of(series),
        Chart::Histogram { series, .. } => of(series),
        Chart::Strips { series, .. }
        | Chart::StackedBars { series, .. }
        | Chart::GroupedBars { series, .. } => of(series),
    }
}

#[test]
fn every_series_is_named_in_its_colour() {
    for chart in charts() {
        let picture = Picture::read(&figure("", &[panel("", chart.clone())], 1));
        for name in names(&chart) {
            picture.find(name);
        }
        if let Chart::Scatter { series, .. } = &chart {
            for series in series {
                let words = picture.find(&series.name);
                let square = picture
                    .squares
                    .iter()
                    .filter(|square| square.right() < words.across.start);
                let nearest = square
                    .filter(|square| (square.top..square.bottom()).contains(&words.y))
                    .max_by(|one, other| one.left.total_cmp(&other.left))
                    .unwrap();
                assert_eq!(nearest.colour, series.colour, "{}", series.name);
            }
        }
    }
}

#[test]
fn legends_do_not_cover_data() {
    for chart in charts() {
        let picture = Picture::read(&figure("", &[panel("", chart)], 1));
        let lowest = picture
            .dots
            .iter()
            .map(|dot| dot.y)
            .chain(picture.bars.iter().map(Bar::bottom));
        let lowest = lowest.fold(0.0, f64::max);
        assert!(picture.squares.iter().all(|square| square.top > lowest));
    }
}

#[test]
fn panels_with_the_same_legend_share_it() {
    let chart = charts().swap_remove(2);
    let panels: Vec<_> = ["Thumb", "Index"]
        .map(|title| panel(title, chart.clone()))
        .to_vec();
    let picture = Picture::read(&figure("Digits", &panels, 2));
    assert_eq!(picture.squares.len(), 3);
    picture.find("Bend ratio 1.42");

    let different = [panel("Thumb", chart), panel("Kinds", charts().swap_remove(0))];
    assert_eq!(Picture::read(&figure("", &different, 2)).squares.len(), 6);
}

#[test]
fn panels_are_laid_out_in_rows() {
    let titles = ["One", "Two", "Three", "Four", "Five"];
    let chart = charts().swap_remove(0);
    let panels: Vec<_> = titles.map(|title| panel(title, chart.clone())).to_vec();
    let picture = Picture::read(&figure("All", &panels, 3));
    let places = titles
        .map(|title| picture.find(title))
        .map(|words| (words.x, words.y));
    assert!(places[0].0 < places[1].0 && places[1].0 < places[2].0);
    assert!(places[..3].iter().all(|place| place.1 == places[0].1));
    assert!(places[3].1 > places[0].1 && places[3].1 == places[4].1);
    assert!((places[3].0 - places[0].0).abs() < 100.0 && (places[4].0 - places[1].0).abs() < 100.0);
    assert!(picture.find("All").y < places[0].1);
}

#[test]
fn words_stay_inside_and_do_not_overlap() {
    for columns in 1..=3 {
        let panels: Vec<_> = charts()
            .into_iter()
            .map(|chart| panel("What the panel shows", chart))
            .collect();
        let picture = Picture::read(&figure("What the figure shows", &panels, columns));
        picture.assert_all_inside();
        picture.assert_words_apart();
    }
}

#[test]
fn long_names_stay_inside_and_do_not_overlap() {
    let long = "a name that is much longer than the room that there is for it in any chart at all, however wide it is";
    let mut charts = charts();
    for chart in &mut charts {
        match chart {
            Chart::Scatter { x, y, series } => {
                (x.label, y.label) = (long.to_owned(), long.to_owned());
                for series in series {
                    series.name = long.to_owned();
                }
            }
            Chart::Strips { series, .. } => {
                for series in series {
                    series.name = long.to_owned();
                }
            }
            Chart::Histogram { label, .. } => *label = long.to_owned(),
            Chart::StackedBars { rows, .. } => rows.fill(long.to_owned()),
            Chart::GroupedBars { groups, .. } => groups[0] = long.replace(' ', ""),
        }
    }
    let panels: Vec<_> = charts.into_iter().map(|chart| panel(long, chart)).collect();
    let picture = Picture::read(&figure(&format!("{long} {long}"), &panels, 2));
    picture.assert_all_inside();
    picture.assert_words_apart();
}

#[test]
fn text_is_escaped() {
    let chart = Chart::Scatter {
        x: axis("a < b & c > \"d\"", 0.0, 1.0),
        y: axis("it's", 0.0, 1.0),
        series: vec![series("<circle/>", palette::VALID, Vec::new())],
    };
    let picture = Picture::read(&figure("</svg>", &[panel("&amp;", chart)], 1));
    for text in ["a < b & c > \"d\"", "it's", "<circle/>", "</svg>", "&amp;"] {
        picture.find(text);
    }
    assert!(picture.dots.is_empty());
    // XML forbids most control characters.
    let picture = Picture::read(&figure("one\u{0}two\u{1b}three\nfour\u{ffff}", &[], 1));
    picture.find("one two three four");
}

#[test]
fn the_same_data_gives_the_same_bytes() {
    let panels = || {
        charts()
            .into_iter()
            .map(|chart| panel("Same", chart))
            .collect::<Vec<Panel>>()
    };
    assert_eq!(figure("Same", &panels(), 2), figure("Same", &panels(), 2));
}

#[test]
fn a_scatter_of_a_whole_set_stays_small() {
    let dots = scattered(1875, 1.0)
        .into_iter()
        .zip(scattered(1875, 1.37))
        .collect();
    let chart = Chart::Scatter {
        x: axis("x", 0.0, 1.0),
        y: axis("y", 0.0, 1.0),
        series: vec![series("s", palette::HERE, dots)],
    };
    let svg = figure("", &[panel("", chart)], 1);
    assert!(Picture::read(&svg).dots.len() > 1700, "they hardly share pixels");
    assert!(svg.len() < 90_000, "{} bytes", svg.len());
}
