//! Tools and what comes with them.

use glam::DVec3;

use super::v;
use crate::{
    about::{EverydayObject, Fill::Solid, Hands, Source},
    curves::{ellipse, rounded},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        hammer(),
        screwdriver(),
        wrench(),
        pliers(),
        saw(),
        drill(),
        trowel(),
        axe(),
        brick(),
        dumbbell(),
    ]
}

fn hammer() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.15));
    s.at(DVec3::ZERO, DVec3::X).stretched(0.75, 1.0, 1.0);
    s.lathe(&[
        [14.0, -240.0],
        [17.0, -232.0],
        [16.0, -140.0],
        [13.0, -60.0],
        [13.0, 32.0],
    ]);
    s.part("head", Solid(0.5));
    s.at(v(15.0, 0.0, 25.0), DVec3::Z).lathe(&[
        [12.0, -30.0],
        [15.0, -26.0],
        [13.0, 0.0],
        [13.5, 25.0],
        [13.5, 32.0],
    ]);
    s.at(DVec3::ZERO, DVec3::Y);
    s.loft(&[
        vec![
            v(28.0, -11.0, 0.0),
            v(2.0, -11.0, 0.0),
            v(2.0, 11.0, 0.0),
            v(28.0, 11.0, 0.0),
        ],
        vec![
            v(28.0, -1.5, -55.0),
            v(2.0, -1.5, -55.0),
            v(2.0, 1.5, -55.0),
            v(28.0, 1.5, -55.0),
        ],
    ]);
    s.finish(About {
        name: "hammer",
        what: "A hammer with a head of 500 g, lying",
        size_mm: [272.0, 30.0, 112.0],
        source: Source::Standard,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn screwdriver() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.06));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe_with(
        12,
        &[
            [11.0, -105.0],
            [16.0, -98.0],
            [16.0, -55.0],
            [12.0, -25.0],
            [14.0, -8.0],
            [9.0, 0.0],
        ],
    );
    s.part("shaft", Solid(0.04));
    s.at(DVec3::ZERO, DVec3::X)
        .lathe_with(12, &[[3.0, -5.0], [3.0, 100.0], [2.0, 115.0]]);
    s.finish(About {
        name: "screwdriver",
        what: "A screwdriver, lying",
        size_mm: [220.0, 32.0, 32.0],
        source: Source::Product,
        surface: Surface::Rubber,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn wrench() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("shank", Solid(0.12));
    let shank: Vec<_> = (0..=6)
        .map(|i| v(-85.0 + 25.0 * f64::from(i), 0.0, 0.0))
        .collect();
    s.strap(&shank, DVec3::Y, |_| [3.5, 9.0]);
    s.part("ring", Solid(0.04));
    s.hoop(
        &ellipse(v(-97.0, 0.0, 0.0), DVec3::X * 12.0, DVec3::NEG_Z * 12.0, 24),
        DVec3::Y,
        [5.0, 4.0],
    );
    s.part("jaw", Solid(0.05));
    s.at(v(71.0, 0.0, 0.0), DVec3::Y)
        .slab([22.0, 8.0, 40.0], 8.0, 1.0);
    for side in [-1.0, 1.0] {
        s.at(v(91.0, 0.0, side * 14.5), DVec3::Y)
            .slab([32.0, 7.5, 11.0], 3.0, 0.8);
    }
    s.finish(About {
        name: "wrench",
        what: "A combination wrench for 17 mm, lying",
        size_mm: [220.0, 10.0, 40.0],
        source: Source::Standard,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn pliers() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handles", Solid(0.12));
    for side in [-1.0, 1.0] {
        let path = [
            v(-115.0, 0.0, side * 24.0),
            v(-70.0, 0.0, side * 26.0),
            v(-25.0, 0.0, side * 14.0),
            v(3.0, 0.0, side * 6.0),
        ];
        s.strap(&rounded(&path, 15.0), DVec3::Y, |_| [6.0, 6.5]);
    }
    s.part("jaws", Solid(0.1));
    s.at(DVec3::ZERO, DVec3::Y).lathe(&[[13.0, -6.0], [13.0, 6.0]]);
    let section = |x: f64, half: f64| {
        vec![
            v(x, 4.5, half),
            v(x, -4.5, half),
            v(x, -4.5, -half),
            v(x, 4.5, -half),
        ]
    };
    s.loft(&[section(5.0, 12.0), section(30.0, 10.0), section(52.0, 5.0)]);
    s.finish(About {
        name: "pliers",
        what: "Closed pliers, lying",
        size_mm: [167.0, 12.0, 64.0],
        source: Source::Product,
        surface: Surface::Rubber,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn saw() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.2));
    let grip = ellipse(v(-60.0, 0.0, 0.0), DVec3::X * 42.0, DVec3::Y * 58.0, 32);
    s.hoop(&grip, DVec3::Z, [11.0, 14.0]);
    s.part("blade", Solid(0.25));
    s.loft(&[
        vec![
            v(-20.0, 55.0, 0.6),
            v(-20.0, 55.0, -0.6),
            v(-20.0, -55.0, -0.6),
            v(-20.0, -55.0, 0.6),
        ]
        .into_iter()
        .rev()
        .collect(),
        vec![
            v(430.0, 0.0, 0.6),
            v(430.0, 0.0, -0.6),
            v(430.0, -55.0, -0.6),
            v(430.0, -55.0, 0.6),
        ]
        .into_iter()
        .rev()
        .collect(),
    ]);
    s.finish(About {
        name: "saw",
        what: "A hand saw; its blade is forbidden",
        size_mm: [546.0, 144.0, 22.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["blade"],
        hands: Hands::One,
    })
}

fn drill() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("motor", Solid(0.7));
    s.at(DVec3::ZERO, DVec3::X)
        .lathe(&[[26.0, -85.0], [30.0, -78.0], [30.0, 55.0], [24.0, 62.0]]);
    s.part("chuck", Solid(0.2));
    s.at(DVec3::ZERO, DVec3::X)
        .lathe(&[[21.0, 55.0], [21.0, 95.0], [11.0, 112.0]]);
    s.part("handle", Solid(0.15));
    let handle = [v(-45.0, -20.0, 0.0), v(-58.0, -140.0, 0.0)];
    s.strap(&handle, DVec3::Z, |_| [16.0, 20.0]);
    s.part("battery", Solid(0.4));
    s.at(v(-45.0, -158.0, 0.0), DVec3::Y)
        .slab([115.0, 50.0, 72.0], 8.0, 5.0);
    s.finish(About {
        name: "drill",
        what: "A cordless drill; its chuck is forbidden",
        size_mm: [215.0, 213.0, 72.0],
        source: Source::Product,
        surface: Surface::Rubber,
        forbidden: &["chuck"],
        hands: Hands::One,
    })
}

fn trowel() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.09));
    s.at(DVec3::ZERO, DVec3::X).lathe(&[
        [11.0, -130.0],
        [16.0, -122.0],
        [14.0, -60.0],
        [16.0, -20.0],
        [10.0, 0.0],
    ]);
    s.part("neck", Solid(0.05));
    s.tube(
        &rounded(&[v(-5.0, 0.0, 0.0), v(30.0, 0.0, 0.0), v(60.0, -25.0, 0.0)], 15.0),
        DVec3::Z,
        |_| 5.0,
    );
    s.part("blade", Solid(0.11));
    let section = |x: f64, half: f64, y: f64| {
        vec![
            v(x, y, half),
            v(x, y - 1.5, 0.0),
            v(x, y, -half),
            v(x, y + 1.5, 0.0),
        ]
    };
    s.loft(&[
        section(50.0, 30.0, -18.0),
        section(90.0, 40.0, -18.0),
        section(160.0, 34.0, -20.0),
        section(205.0, 8.0, -22.0),
    ]);
    s.finish(About {
        name: "trowel",
        what: "A garden trowel; its blade is forbidden",
        size_mm: [335.0, 46.0, 80.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["blade"],
        hands: Hands::One,
    })
}

fn axe() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.25));
    s.stretched(1.0, 1.0, 0.65);
    s.lathe(&[
        [18.0, 0.0],
        [21.0, 8.0],
        [17.0, 50.0],
        [17.0, 300.0],
        [18.0, 385.0],
    ]);
    s.part("head", Solid(0.65));
    let section = |x: f64, low: f64, high: f64, half: f64| {
        vec![
            v(x, low, half),
            v(x, low, -half),
            v(x, high, -half),
            v(x, high, half),
        ]
    };
    s.loft(&[
        section(-32.0, 335.0, 375.0, 14.0),
        section(20.0, 333.0, 377.0, 14.0),
        section(60.0, 320.0, 380.0, 6.0),
        section(95.0, 300.0, 390.0, 0.5),
    ]);
    s.finish(About {
        name: "axe",
        what: "A hatchet, upright; its head is forbidden",
        size_mm: [127.0, 390.0, 28.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["head"],
        hands: Hands::One,
    })
}

fn brick() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("brick", Solid(3.4));
    s.slab([240.0, 71.0, 115.0], 0.0, 0.0);
    s.finish(About {
        name: "brick",
        what: "A solid brick, lying",
        size_mm: [240.0, 71.0, 115.0],
        source: Source::Standard,
        surface: Surface::Rough,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn dumbbell() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("dumbbell", Solid(5.0));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe(&[
        [40.0, -100.0],
        [50.0, -90.0],
        [50.0, -72.0],
        [42.0, -65.0],
        [14.0, -64.0],
        [16.0, 0.0],
        [14.0, 64.0],
        [42.0, 65.0],
        [50.0, 72.0],
        [50.0, 90.0],
        [40.0, 100.0],
    ]);
    s.finish(About {
        name: "dumbbell",
        what: "A dumbbell of 5 kg, lying",
        size_mm: [200.0, 100.0, 100.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}
