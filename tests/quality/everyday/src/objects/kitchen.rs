//! What is used at a stove.

use glam::DVec3;
use grasp_mesh_builder::sin_cos_degrees;

use super::v;
use crate::{
    about::{EverydayObject, Fill::Solid, Hands, Source},
    curves::{arc, ellipse, rod, rounded, vessel},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        pan(),
        pot(),
        kettle(),
        kitchen_knife(),
        kitchen_scissors(),
        spatula(),
        ladle(),
        whisk(),
        rolling_pin(),
        cutting_board(),
        peeler(),
    ]
}

fn pan() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bowl", Solid(0.75));
    s.lathe(&vessel(&[[95.0, 0.0], [105.0, 5.0], [130.0, 48.0]], 4.0));
    s.part("handle", Solid(0.2));
    let handle = [v(118.0, 34.0, 0.0), v(160.0, 50.0, 0.0), v(315.0, 70.0, 0.0)];
    s.strap(&rounded(&handle, 30.0), DVec3::Z, |share| {
        [9.0 + 4.0 * share, 7.0]
    });
    s.finish(About {
        name: "pan",
        what: "A frying pan of 26 cm; its bowl is forbidden",
        size_mm: [447.0, 77.0, 260.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["bowl"],
        hands: Hands::One,
    })
}

fn pot() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("pot", Solid(1.6));
    s.lathe(&vessel(&[[105.0, 0.0], [110.0, 5.0], [110.0, 140.0]], 4.0));
    s.part("soup", Solid(3.5));
    s.lathe(&[[105.0, 5.0], [105.0, 105.0]]);
    s.part("handles", Solid(0.2));
    for side in [-1.0, 1.0] {
        let path = [
            v(side * 108.0, 115.0, -45.0),
            v(side * 150.0, 118.0, -40.0),
            v(side * 150.0, 118.0, 40.0),
            v(side * 108.0, 115.0, 45.0),
        ];
        s.tube(&rounded(&path, 18.0), DVec3::Y, |_| 6.0);
    }
    s.finish(About {
        name: "pot",
        what: "A pot of soup with two handles; pot and soup are hot",
        size_mm: [312.0, 140.0, 220.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &["pot", "soup"],
        hands: Hands::Beyond {
            why: "5.3 kg, centred 15 cm from either handle: 8 N m, and it must stay level",
        },
    })
}

fn kettle() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("body", Solid(0.8));
    s.lathe(&[
        [75.0, 0.0],
        [80.0, 6.0],
        [76.0, 60.0],
        [58.0, 150.0],
        [55.0, 190.0],
        [20.0, 205.0],
        [12.0, 206.0],
        [12.0, 218.0],
        [8.0, 222.0],
    ]);
    s.part("water", Solid(1.0));
    s.lathe(&[[70.0, 5.0], [70.0, 70.0]]);
    s.part("handle", Solid(0.15));
    let handle = [
        v(-50.0, 180.0, 0.0),
        v(-118.0, 185.0, 0.0),
        v(-122.0, 50.0, 0.0),
        v(-68.0, 38.0, 0.0),
    ];
    s.strap(&rounded(&handle, 28.0), DVec3::Z, |_| [13.0, 9.0]);
    s.part("spout", Solid(0.05));
    s.tube(&[v(45.0, 150.0, 0.0), v(95.0, 190.0, 0.0)], DVec3::Z, |share| {
        20.0 - 8.0 * share
    });
    s.finish(About {
        name: "kettle",
        what: "An electric kettle with a litre of hot water; only its handle may be touched",
        size_mm: [230.0, 222.0, 160.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["body", "water", "spout"],
        hands: Hands::One,
    })
}

fn kitchen_knife() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.09));
    let handle = [
        v(-125.0, -6.0, 0.0),
        v(-105.0, 0.0, 0.0),
        v(-60.0, 0.0, 0.0),
        v(0.0, 2.0, 0.0),
    ];
    s.strap(&handle, DVec3::Z, |share| [9.0 - share, 15.0 - 2.0 * share]);
    s.part("blade", Solid(0.11));
    let section =
        |x: f64, edge: f64, back: f64, half: f64| vec![v(x, edge, 0.0), v(x, back, -half), v(x, back, half)];
    s.loft(&[
        section(-5.0, -30.0, 13.0, 1.3),
        section(120.0, -24.0, 13.0, 1.0),
        section(180.0, -6.0, 11.0, 0.6),
        vec![v(205.0, 9.0, 0.0)],
    ]);
    s.finish(About {
        name: "kitchen-knife",
        what: "A chef's knife; its blade is forbidden",
        size_mm: [330.0, 45.0, 18.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["blade"],
        hands: Hands::One,
    })
}

fn kitchen_scissors() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handles", Solid(0.05));
    for side in [-1.0, 1.0] {
        let bow = ellipse(
            v(-70.0, 0.0, side * 25.0),
            DVec3::X * 36.0,
            DVec3::NEG_Z * 16.0,
            28,
        );
        s.hoop(&bow, DVec3::Y, [4.5, 4.5]);
        s.strap(
            &[v(-38.0, 0.0, side * 18.0), v(5.0, 0.0, side * 3.0)],
            DVec3::Y,
            |_| [4.0, 6.0],
        );
    }
    s.part("blades", Solid(0.06));
    let section = |x: f64, half: f64| {
        vec![
            v(x, 1.7, half),
            v(x, -1.7, half),
            v(x, -1.7, -half),
            v(x, 1.7, -half),
        ]
    };
    s.loft(&[section(0.0, 10.0), section(70.0, 8.0), section(110.0, 2.0)]);
    s.finish(About {
        name: "kitchen-scissors",
        what: "Closed kitchen scissors, lying; their blades are forbidden",
        size_mm: [220.0, 9.0, 91.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["blades"],
        hands: Hands::One,
    })
}

fn spatula() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.06));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe(&[
        [9.0, -130.0],
        [12.0, -125.0],
        [11.0, -20.0],
        [8.0, -5.0],
        [5.0, 0.0],
    ]);
    s.part("shaft", Solid(0.02));
    s.tube(
        &rounded(
            &[v(-5.0, 0.0, 0.0), v(85.0, 0.0, 0.0), v(125.0, -22.0, 0.0)],
            20.0,
        ),
        DVec3::Z,
        |_| 3.5,
    );
    s.part("blade", Solid(0.03));
    s.at(v(165.0, -23.0, 0.0), DVec3::Y)
        .slab([90.0, 2.0, 80.0], 10.0, 0.0);
    s.finish(About {
        name: "spatula",
        what: "A spatula for frying; its blade is forbidden",
        size_mm: [340.0, 37.0, 80.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["blade"],
        hands: Hands::One,
    })
}

fn ladle() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.09));
    let handle = [v(-250.0, 90.0, 0.0), v(-20.0, 70.0, 0.0), v(0.0, 35.0, 0.0)];
    s.strap(&rounded(&handle, 18.0), DVec3::Z, |share| {
        [9.0 - 4.0 * share, 3.0]
    });
    s.part("bowl", Solid(0.06));
    s.at(v(42.0, 0.0, 0.0), DVec3::Y).lathe(&vessel(
        &[[15.0, 0.0], [33.0, 10.0], [43.0, 28.0], [45.0, 42.0]],
        1.5,
    ));
    s.finish(About {
        name: "ladle",
        what: "A ladle; its bowl is forbidden",
        size_mm: [337.0, 93.0, 90.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &["bowl"],
        hands: Hands::One,
    })
}

fn whisk() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.06));
    s.lathe(&[
        [6.0, 0.0],
        [6.5, 10.0],
        [11.0, 40.0],
        [10.0, 110.0],
        [12.0, 128.0],
        [9.0, 132.0],
    ]);
    s.part("wires", Solid(0.03));
    for turn in 0..4 {
        let (sin, cos) = sin_cos_degrees(45.0 * f64::from(turn));
        let across = v(cos, 0.0, -sin);
        let down = |reach: f64, depth: f64| across * reach - DVec3::Y * depth;
        let path: Vec<_> = [
            (-4.0, -8.0),
            (-6.0, 20.0),
            (-30.0, 100.0),
            (-27.0, 140.0),
            (-12.0, 160.0),
        ]
        .into_iter()
        .chain([
            (12.0, 160.0),
            (27.0, 140.0),
            (30.0, 100.0),
            (6.0, 20.0),
            (4.0, -8.0),
        ])
        .map(|(reach, depth)| down(reach, depth))
        .collect();
        s.tube(&path, across.cross(DVec3::Y), |_| 0.8 + 0.01 * f64::from(turn));
    }
    s.finish(About {
        name: "whisk",
        what: "A whisk, hanging; its wires are forbidden",
        size_mm: [62.0, 294.0, 62.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &["wires"],
        hands: Hands::One,
    })
}

fn rolling_pin() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("pin", Solid(0.65));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe(&[
        [8.0, -215.0],
        [13.0, -205.0],
        [11.0, -135.0],
        [28.0, -125.0],
        [30.0, -120.0],
        [30.0, 120.0],
        [28.0, 125.0],
        [11.0, 135.0],
        [13.0, 205.0],
        [8.0, 215.0],
    ]);
    s.finish(About {
        name: "rolling-pin",
        what: "A rolling pin, lying",
        size_mm: [430.0, 60.0, 60.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn cutting_board() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("board", Solid(0.75));
    s.at(DVec3::ZERO, DVec3::Z).slab([320.0, 16.0, 220.0], 12.0, 3.0);
    s.finish(About {
        name: "cutting-board",
        what: "A cutting board, on its edge",
        size_mm: [320.0, 220.0, 16.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn peeler() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.045));
    s.at(DVec3::ZERO, DVec3::X).lathe(&rod(10.0, [-110.0, 0.0]));
    s.part("fork", Solid(0.01));
    let fork = arc(
        v(38.0, 0.0, 0.0),
        27.0,
        [100.0, 260.0],
        14,
        [DVec3::X, DVec3::NEG_Z],
    );
    s.tube(&fork, DVec3::Y, |_| 3.0);
    s.tube(&[v(-5.0, 0.0, 0.0), v(12.0, 0.0, 0.0)], DVec3::Y, |_| 4.0);
    s.part("blade", Solid(0.005));
    s.at(v(33.0, 0.0, 0.0), DVec3::Z).slab([9.0, 50.0, 2.0], 0.0, 0.0);
    s.finish(About {
        name: "peeler",
        what: "A vegetable peeler, lying; its blade is forbidden",
        size_mm: [148.0, 20.0, 60.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["blade"],
        hands: Hands::One,
    })
}
