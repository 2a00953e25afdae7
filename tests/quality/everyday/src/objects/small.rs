//! What lies in a pocket or a palm: coins and cards, balls, fruit.

use glam::DVec3;

use super::v;
use crate::{
    about::{
        EverydayObject,
        Fill::{Skin, Solid},
        Hands, Source,
    },
    curves::{arc, ball, ellipse, rod},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        coin(),
        needle(),
        ring(),
        key(),
        usb_stick(),
        die(),
        matchstick(),
        battery(),
        playing_card(),
        playing_card_sheet(),
        bank_card(),
        banknote(),
        letter(),
        leaf(),
        marble(),
        golf_ball(),
        tennis_ball(),
        basketball(),
        egg(),
        apple(),
        banana(),
    ]
}

fn coin() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("coin", Solid(0.0085));
    s.lathe(&[[12.4, 0.0], [12.875, 0.4], [12.875, 1.8], [12.4, 2.2]]);
    s.finish(About {
        name: "coin",
        what: "A coin of 2 euro, lying",
        size_mm: [25.75, 2.2, 25.75],
        source: Source::Standard,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn needle() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("needle", Solid(0.000_15));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe_with(8, &[[0.0, -20.0], [0.4, -15.0], [0.4, 18.0], [0.2, 20.0]]);
    s.finish(About {
        name: "needle",
        what: "A sewing needle",
        size_mm: [40.0, 0.8, 0.8],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn ring() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("ring", Solid(0.004));
    s.hoop(
        &ellipse(DVec3::ZERO, DVec3::X * 9.6, DVec3::NEG_Z * 9.6, 32),
        DVec3::Y,
        [1.5, 1.0],
    );
    s.finish(About {
        name: "ring",
        what: "A gold ring",
        size_mm: [21.2, 3.0, 21.2],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn key() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bow", Solid(0.006));
    s.hoop(
        &ellipse(DVec3::ZERO, DVec3::X * 9.0, DVec3::NEG_Z * 9.0, 24),
        DVec3::Y,
        [1.1, 4.0],
    );
    s.part("blade", Solid(0.004));
    s.at(v(27.0, 0.0, 0.0), DVec3::Y).slab([36.0, 2.0, 7.5], 0.0, 0.0);
    s.finish(About {
        name: "key",
        what: "A door key, lying",
        size_mm: [58.0, 2.2, 26.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn usb_stick() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("body", Solid(0.007));
    s.slab([45.0, 8.0, 18.0], 3.0, 1.0);
    s.part("plug", Solid(0.002));
    s.at(v(28.0, 0.0, 0.0), DVec3::Y)
        .slab([13.0, 4.5, 12.0], 0.0, 0.0);
    s.finish(About {
        name: "usb-stick",
        what: "A USB stick, lying",
        size_mm: [57.0, 8.0, 18.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn die() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("die", Solid(0.0047));
    s.slab([16.0, 16.0, 16.0], 2.0, 1.5);
    s.finish(About {
        name: "die",
        what: "A die",
        size_mm: [16.0, 16.0, 16.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn matchstick() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("stick", Solid(0.0001));
    s.at(v(22.0, 0.0, 0.0), DVec3::Y).slab([44.0, 2.2, 2.2], 0.0, 0.0);
    s.part("head", Solid(0.000_02));
    s.at(v(44.0, 0.0, 0.0), DVec3::X)
        .stretched(1.6, 3.0, 1.6)
        .lathe_with(12, &ball(1.0));
    s.finish(About {
        name: "matchstick",
        what: "A match",
        size_mm: [47.0, 3.2, 3.2],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["head"],
        hands: Hands::One,
    })
}

fn battery() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("cell", Solid(0.023));
    s.lathe(&[
        [6.75, 0.0],
        [7.25, 0.5],
        [7.25, 48.7],
        [6.75, 49.2],
        [2.75, 49.2],
        [2.75, 50.5],
    ]);
    s.finish(About {
        name: "battery",
        what: "A cell of size AA",
        size_mm: [14.5, 50.5, 14.5],
        source: Source::Standard,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn playing_card() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("card", Solid(0.0018));
    s.at(DVec3::ZERO, DVec3::Z).slab([63.0, 0.3, 88.0], 3.5, 0.0);
    s.finish(About {
        name: "playing-card",
        what: "A playing card, upright",
        size_mm: [63.0, 88.0, 0.3],
        source: Source::Product,
        surface: Surface::Paper,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn playing_card_sheet() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("card", Skin(0.0018));
    s.sheet(&[
        vec![v(-31.5, -44.0, 0.0), v(31.5, -44.0, 0.0)],
        vec![v(-31.5, 44.0, 0.0), v(31.5, 44.0, 0.0)],
    ]);
    s.finish(About {
        name: "playing-card-sheet",
        what: "A playing card as a single quad, upright",
        size_mm: [63.0, 88.0, 0.0],
        source: Source::Product,
        surface: Surface::Paper,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn bank_card() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("card", Solid(0.005));
    s.slab([85.6, 0.76, 53.98], 3.2, 0.0);
    s.finish(About {
        name: "bank-card",
        what: "A bank card, lying",
        size_mm: [85.6, 0.76, 53.98],
        source: Source::Standard,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

/// Rows of a sheet of width and height that bends about the vertical, by `depth` at its middle.
fn bent_sheet(width: f64, height: f64, depth: f64) -> Vec<Vec<DVec3>> {
    const COLUMNS: usize = 8;
    const ROWS: usize = 6;
    (0..=ROWS)
        .map(|row| {
            let y = height * (row as f64 / ROWS as f64 - 0.5);
            (0..=COLUMNS)
                .map(|column| {
                    let share = 2.0 * column as f64 / COLUMNS as f64 - 1.0;
                    v(0.5 * width * share, y, depth * (1.0 - share * share))
                })
                .collect()
        })
        .collect()
}

fn banknote() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("note", Skin(0.0011));
    s.sheet(&bent_sheet(140.0, 77.0, 4.0));
    s.finish(About {
        name: "banknote",
        what: "A note of 50 euro, a sheet without thickness",
        size_mm: [140.0, 77.0, 4.0],
        source: Source::Standard,
        surface: Surface::Paper,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn letter() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("paper", Skin(0.005));
    s.sheet(&bent_sheet(210.0, 297.0, 15.0));
    s.finish(About {
        name: "letter",
        what: "A sheet of A4 paper, upright, without thickness",
        size_mm: [210.0, 297.0, 15.0],
        source: Source::Standard,
        surface: Surface::Paper,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn leaf() -> EverydayObject {
    const ROWS: usize = 10;
    let mut s = Sketch::new();
    s.part("blade", Skin(0.0006));
    let rows: Vec<Vec<DVec3>> = (0..=ROWS)
        .map(|row| {
            let share = row as f64 / ROWS as f64;
            let half_width = 1.0 + 118.0 * share * (1.0 - share);
            let fold = 0.25 * half_width;
            let [x, y] = [100.0 * share, 6.0 * share];
            vec![
                v(x, y + fold, half_width),
                v(x, y, 0.0),
                v(x, y + fold, -half_width),
            ]
        })
        .collect();
    s.sheet(&rows);
    s.part("stalk", Solid(0.0002));
    s.tube(
        &[v(-40.0, -1.0, 0.0), v(-20.0, 0.5, 0.0), v(2.0, 0.0, 0.0)],
        DVec3::Z,
        |_| 0.8,
    );
    s.finish(About {
        name: "leaf",
        what: "A leaf with its stalk; the blade has no thickness",
        size_mm: [140.0, 12.5, 61.0],
        source: Source::Typical,
        surface: Surface::Natural,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn marble() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("marble", Solid(0.0054));
    s.lathe(&ball(8.0));
    s.finish(About {
        name: "marble",
        what: "A glass marble",
        size_mm: [16.0, 16.0, 16.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn golf_ball() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("ball", Solid(0.0459));
    s.lathe(&ball(21.35));
    s.finish(About {
        name: "golf-ball",
        what: "A golf ball",
        size_mm: [42.7, 42.7, 42.7],
        source: Source::Standard,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn tennis_ball() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("ball", Skin(0.058));
    s.lathe(&ball(33.35));
    s.finish(About {
        name: "tennis-ball",
        what: "A tennis ball",
        size_mm: [66.7, 66.7, 66.7],
        source: Source::Standard,
        surface: Surface::Cloth,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn basketball() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("ball", Skin(0.6));
    s.lathe(&ball(122.0));
    s.finish(About {
        name: "basketball",
        what: "A basketball of size 7",
        size_mm: [244.0, 244.0, 244.0],
        source: Source::Standard,
        surface: Surface::Leather,
        forbidden: &[],
        hands: Hands::Beyond {
            why: "244 mm across: an ordinary hand does not reach far enough around it",
        },
    })
}

fn egg() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("egg", Solid(0.058));
    let profile: Vec<_> = ball(1.0)
        .into_iter()
        // The thick end is below.
        .map(|[radius, height]| [radius * (22.3 - 2.6 * height), 28.5 * height])
        .collect();
    s.lathe(&profile);
    s.finish(About {
        name: "egg",
        what: "A hen's egg of class M",
        size_mm: [45.0, 57.0, 45.0],
        source: Source::Standard,
        surface: Surface::Natural,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn apple() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("apple", Solid(0.18));
    let profile: Vec<_> = ball(1.0)
        .into_iter()
        .map(|[radius, height]| {
            [
                40.0 * radius,
                36.0 * height - 8.0 * height * (1.0 - radius).powi(2),
            ]
        })
        .collect();
    s.lathe(&profile);
    s.part("stalk", Solid(0.0005));
    s.at(v(0.0, 26.0, 0.0), v(0.2, 1.0, 0.0))
        .lathe_with(8, &rod(1.5, [0.0, 16.0]));
    s.finish(About {
        name: "apple",
        what: "An apple with its stalk",
        size_mm: [80.0, 72.0, 80.0],
        source: Source::Typical,
        surface: Surface::Natural,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn banana() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("banana", Solid(0.15));
    let spine = arc(
        v(0.0, 110.0, 0.0),
        110.0,
        [-140.0, -38.0],
        20,
        [DVec3::X, DVec3::Y],
    );
    s.tube(&spine, DVec3::Z, |share| {
        let rounding = (1.0 - (2.0 * share - 1.0).powi(6)).max(0.0);
        4.0 + 13.5 * rounding
    });
    s.finish(About {
        name: "banana",
        what: "A banana, lying on its back",
        size_mm: [176.0, 63.0, 35.0],
        source: Source::Typical,
        surface: Surface::Natural,
        forbidden: &[],
        hands: Hands::One,
    })
}
