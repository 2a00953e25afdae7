//! Bars are as long as their values.

use crate::plot::Chart;

use crate::tests::fixtures::charts::{
    BLUE, GREEN, RED, ROUNDING, assert_near, line, picture_of, series, strings,
};

#[test]
fn histogram_bars_are_stacked_and_as_high_as_their_counts() {
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
    for (bin, counts) in (0..4).map(|bin| (bin, counts.map(|counts| counts[bin]))) {
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
            let count = counts[place];
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
    // Values are in parts with enough room, sums after bars of different lengths.
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
fn values_over_narrow_bars_are_upright_and_inside_the_picture() {
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
