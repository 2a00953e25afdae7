//! The colours of a chart are distinguishable, also with colour vision deficiencies.

use crate::plot::{Colour, palette};

/// How linear RGB looks to people without one kind of cone (Machado, Oliveira and Fernandes, "A Physiologically-based
/// Model for Simulation of Color Vision Deficiency", 2009, severity 1.0), and to those with all.
const SIGHTS: [(&str, [[f64; 3]; 3]); 4] = [
    ("all cones", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    (
        "protanopia",
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
    ),
    (
        "deuteranopia",
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ),
    (
        "tritanopia",
        [
            [1.255_528, -0.076_749, -0.178_779],
            [-0.078_411, 0.930_809, 0.147_602],
            [0.004_733, 0.691_367, 0.303_900],
        ],
    ),
];

/// Least distance in CIELAB (ΔE 1976) of two colours of a chart. About 2 is just noticeable.
const APART: f64 = 15.0;

fn lab(Colour(red, green, blue): Colour, sight: &[[f64; 3]; 3]) -> [f64; 3] {
    let linear = [red, green, blue].map(|channel| {
        let value = f64::from(channel) / 255.0;
        if value <= 0.04045 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        }
    });
    let times = |matrix: &[[f64; 3]; 3], vector: [f64; 3]| {
        matrix.map(|row| {
            row.iter()
                .zip(vector)
                .map(|(factor, value)| factor * value)
                .sum::<f64>()
        })
    };
    let seen = times(sight, linear).map(|value| value.clamp(0.0, 1.0));
    // sRGB to XYZ under D65, relative to white.
    let xyz = times(
        &[
            [0.412_456, 0.357_576, 0.180_438],
            [0.212_673, 0.715_152, 0.072_175],
            [0.019_334, 0.119_192, 0.950_304],
        ],
        seen,
    );
    let root = |value: f64| {
        if value > 216.0 / 24389.0 {
            value.cbrt()
        } else {
            (24389.0 / 27.0 * value + 16.0) / 116.0
        }
    };
    let [x, y, z] = [xyz[0] / 0.95047, xyz[1], xyz[2] / 1.08883].map(root);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn assert_apart(colours: &[Colour]) {
    for (name, sight) in &SIGHTS {
        for (index, one) in colours.iter().enumerate() {
            for other in &colours[..index] {
                let (first, second) = (lab(*one, sight), lab(*other, sight));
                let distance = first
                    .iter()
                    .zip(second)
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f64>()
                    .sqrt();
                assert!(distance >= APART, "{one:?} and {other:?} with {name}: {distance}");
            }
        }
    }
}

#[test]
fn white_and_black_are_a_hundred_apart() {
    for (_, sight) in &SIGHTS {
        let (white, black) = (lab(Colour(255, 255, 255), sight), lab(Colour(0, 0, 0), sight));
        assert!((white[0] - 100.0).abs() < 0.1 && black[0].abs() < 1e-9);
    }
}

#[test]
fn colours_of_a_chart_are_distinguishable() {
    let and = |colours: &[Colour], more: Colour| [colours, &[more]].concat();
    assert_apart(&and(&palette::REJECTIONS, palette::VALID));
    assert_apart(&[palette::NO_CONTACTS, palette::OTHER_REJECTIONS, palette::VALID]);
    assert_apart(&palette::STEPS);
    assert_apart(&palette::BEND_RATIOS);
    assert_apart(&[palette::HERE, palette::HERE_ON_MORE_THREADS, palette::THESIS]);
}

#[test]
fn all_colours_are_visible_on_white() {
    let all = [&palette::REJECTIONS[..], &palette::STEPS, &palette::BEND_RATIOS].concat();
    let more = [
        palette::VALID,
        palette::OTHER_REJECTIONS,
        palette::HERE,
        palette::HERE_ON_MORE_THREADS,
        palette::THESIS,
    ];
    for colour in all.into_iter().chain(more) {
        assert_apart(&[Colour(255, 255, 255), colour]);
    }
}
