//! What is used around the house.

use glam::DVec3;

use super::v;
use crate::{
    about::{
        EverydayObject,
        Fill::{Skin, Solid},
        Hands, Source,
    },
    curves::{arc, ellipse, rod, rounded},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        toothbrush(),
        comb(),
        hair_brush(),
        hair_dryer(),
        iron(),
        light_bulb(),
        clothes_hanger(),
        spray_bottle(),
        paint_brush(),
        soap(),
        chair(),
        moving_box(),
        steering_wheel(),
    ]
}

fn toothbrush() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.014));
    let handle = [
        v(-95.0, 0.0, 0.0),
        v(-60.0, 0.0, 0.0),
        v(-20.0, 1.0, 0.0),
        v(30.0, 0.0, 0.0),
        v(55.0, 0.0, 0.0),
    ];
    s.strap(&handle, DVec3::Y, |share| [5.5 - 2.5 * share, 6.5 - 3.5 * share]);
    s.part("head", Solid(0.004));
    s.at(v(72.0, 0.0, 0.0), DVec3::Y)
        .slab([36.0, 5.0, 12.0], 4.0, 1.0);
    s.at(v(73.0, 8.0, 0.0), DVec3::Y)
        .slab([28.0, 12.0, 9.0], 0.0, 0.0);
    s.finish(About {
        name: "toothbrush",
        what: "A toothbrush, lying; its head is forbidden",
        size_mm: [185.0, 19.5, 13.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["head"],
        hands: Hands::One,
    })
}

fn comb() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("back", Solid(0.012));
    s.at(v(0.0, 0.0, 10.0), DVec3::Y)
        .slab([180.0, 4.0, 14.0], 4.0, 1.0);
    s.part("teeth", Solid(0.006));
    for tooth in 0..30 {
        let x = 5.6 * (f64::from(tooth) - 14.5);
        s.at(v(x, 0.0, -8.0), DVec3::Y).slab([2.2, 2.4, 24.0], 0.0, 0.0);
    }
    s.finish(About {
        name: "comb",
        what: "A comb, lying",
        size_mm: [180.0, 4.0, 37.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn hair_brush() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.06));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe(&[
        [8.0, -125.0],
        [12.0, -120.0],
        [10.0, -60.0],
        [12.0, -30.0],
        [8.0, 5.0],
    ]);
    s.part("head", Solid(0.06));
    s.at(v(50.0, 0.0, 0.0), DVec3::Y).stretched(1.7, 1.0, 1.0);
    s.lathe(&[[26.0, -9.0], [30.0, -4.0], [30.0, 6.0], [27.0, 10.0]]);
    s.part("bristles", Solid(0.01));
    s.at(v(50.0, 8.0, 0.0), DVec3::Y).stretched(1.7, 1.0, 1.0);
    s.lathe(&[[24.0, 0.0], [25.0, 18.0]]);
    s.finish(About {
        name: "hair-brush",
        what: "A hair brush, lying; its bristles are forbidden",
        size_mm: [226.0, 38.0, 60.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["bristles"],
        hands: Hands::One,
    })
}

fn hair_dryer() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("barrel", Solid(0.38));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe(&[
        [30.0, -90.0],
        [42.0, -80.0],
        [42.0, 0.0],
        [30.0, 50.0],
        [27.0, 95.0],
    ]);
    s.part("handle", Solid(0.17));
    let handle = [v(-40.0, -30.0, 0.0), v(-38.0, -90.0, 0.0), v(-25.0, -170.0, 0.0)];
    s.strap(&rounded(&handle, 30.0), DVec3::Z, |_| [15.0, 19.0]);
    s.finish(About {
        name: "hair-dryer",
        what: "A hair dryer, upright",
        size_mm: [185.0, 215.0, 84.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn iron() -> EverydayObject {
    let mut s = Sketch::new();
    let section = |x: f64, half: f64, top: f64| {
        vec![
            v(x, 0.0, half),
            v(x, 0.0, -half),
            v(x, top, -0.8 * half),
            v(x, top, 0.8 * half),
        ]
    };
    s.part("sole", Solid(1.0));
    s.loft(&[
        section(-120.0, 52.0, 60.0),
        section(0.0, 55.0, 60.0),
        section(80.0, 38.0, 50.0),
        section(140.0, 4.0, 25.0),
    ]);
    s.part("handle", Solid(0.25));
    let handle = [
        v(-95.0, 50.0, 0.0),
        v(-95.0, 125.0, 0.0),
        v(55.0, 125.0, 0.0),
        v(75.0, 35.0, 0.0),
    ];
    s.strap(&rounded(&handle, 25.0), DVec3::Z, |_| [16.0, 13.0]);
    s.finish(About {
        name: "iron",
        what: "A hot iron; only its handle may be touched",
        size_mm: [260.0, 138.0, 110.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["sole"],
        hands: Hands::One,
    })
}

fn light_bulb() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("glass", Skin(0.025));
    s.lathe(&[
        [13.0, 22.0],
        [14.0, 34.0],
        [20.0, 50.0],
        [28.0, 68.0],
        [30.0, 80.0],
        [27.0, 94.0],
        [19.0, 104.0],
        [9.0, 109.0],
        [0.0, 110.0],
    ]);
    s.part("cap", Solid(0.01));
    s.lathe(&[[5.0, 0.0], [13.0, 5.0], [13.2, 28.0]]);
    s.finish(About {
        name: "light-bulb",
        what: "A light bulb with an E27 cap",
        size_mm: [60.0, 110.0, 60.0],
        source: Source::Standard,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn clothes_hanger() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bow", Solid(0.1));
    let bow = [v(-215.0, -105.0, 0.0), v(0.0, 0.0, 0.0), v(215.0, -105.0, 0.0)];
    s.strap(&rounded(&bow, 60.0), DVec3::Z, |_| [6.0, 8.0]);
    s.part("bar", Solid(0.03));
    s.tube(&[v(-205.0, -103.0, 0.0), v(205.0, -103.0, 0.0)], DVec3::Z, |_| {
        4.5
    });
    s.part("hook", Solid(0.02));
    let mut hook = vec![v(0.0, -22.0, 0.0), v(0.0, 20.0, 0.0)];
    hook.extend(arc(
        v(0.0, 50.0, 0.0),
        20.0,
        [-60.0, 190.0],
        18,
        [DVec3::X, DVec3::Y],
    ));
    s.tube(&hook, DVec3::Z, |_| 1.8);
    s.finish(About {
        name: "clothes-hanger",
        what: "A wooden clothes hanger",
        size_mm: [437.0, 184.0, 12.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn spray_bottle() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bottle", Solid(0.55));
    s.stretched(1.3, 1.0, 1.0);
    s.lathe(&[
        [33.0, 0.0],
        [36.0, 4.0],
        [36.0, 120.0],
        [18.0, 175.0],
        [13.0, 200.0],
    ]);
    s.part("head", Solid(0.04));
    s.at(v(10.0, 225.0, 0.0), DVec3::Y)
        .slab([95.0, 30.0, 26.0], 5.0, 4.0);
    s.at(DVec3::ZERO, DVec3::Y).lathe(&[[15.0, 190.0], [15.0, 212.0]]);
    s.part("trigger", Solid(0.01));
    s.strap(
        &[v(32.0, 214.0, 0.0), v(38.0, 190.0, 0.0), v(48.0, 165.0, 0.0)],
        DVec3::Z,
        |_| [8.0, 3.0],
    );
    s.finish(About {
        name: "spray-bottle",
        what: "A full spray bottle",
        size_mm: [104.0, 240.0, 72.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn paint_brush() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.05));
    let handle: Vec<_> = [
        (-130.0, 7.0, 7.0),
        (-120.0, 9.0, 9.0),
        (-60.0, 6.0, 7.0),
        (-20.0, 7.0, 14.0),
        (5.0, 8.0, 24.0),
    ]
    .into_iter()
    .map(|(x, thick, wide)| ellipse(v(x, 0.0, 0.0), DVec3::Y * thick, DVec3::Z * wide, 16))
    .collect();
    s.loft(&handle);
    s.part("ferrule", Solid(0.02));
    s.at(v(18.0, 0.0, 0.0), DVec3::Y)
        .slab([40.0, 17.0, 50.0], 0.0, 0.0);
    s.part("bristles", Solid(0.02));
    s.at(v(64.0, 0.0, 0.0), DVec3::Y)
        .slab([56.0, 13.0, 48.0], 0.0, 0.0);
    s.finish(About {
        name: "paint-brush",
        what: "A flat paint brush, lying; its bristles are forbidden",
        size_mm: [222.0, 18.0, 50.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["bristles"],
        hands: Hands::One,
    })
}

fn soap() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("soap", Solid(0.1));
    s.slab([80.0, 25.0, 55.0], 20.0, 8.0);
    s.finish(About {
        name: "soap",
        what: "A dry cake of soap, lying",
        size_mm: [80.0, 25.0, 55.0],
        source: Source::Product,
        surface: Surface::Natural,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn chair() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("seat", Solid(2.0));
    s.at(v(0.0, 450.0, 0.0), DVec3::Y)
        .slab([420.0, 25.0, 420.0], 30.0, 5.0);
    s.part("legs", Solid(1.6));
    for [x, z] in [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]] {
        s.at(v(x * 180.0, 0.0, z * 180.0), DVec3::Y)
            .lathe_with(12, &rod(17.0, [0.0, 445.0]));
    }
    s.part("back", Solid(1.4));
    for z in [-180.0, 180.0] {
        s.tube(&[v(-180.0, 455.0, z), v(-225.0, 880.0, z)], DVec3::Z, |_| 15.0);
    }
    for y in [640.0, 740.0, 850.0] {
        let x = -180.0 - 45.0 * (y - 455.0) / 425.0;
        s.strap(&[v(x, y, -180.0), v(x, y, 180.0)], DVec3::X, |_| [8.0, 25.0]);
    }
    s.finish(About {
        name: "chair",
        what: "A wooden chair",
        size_mm: [450.0, 880.0, 420.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::Beyond {
            why: "5 kg, and upright its weight is 20 cm in front of the back: 10 N m",
        },
    })
}

fn moving_box() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("box", Solid(4.0));
    s.slab([400.0, 400.0, 400.0], 0.0, 0.0);
    s.finish(About {
        name: "moving-box",
        what: "A filled cardboard box without grips",
        size_mm: [400.0, 400.0, 400.0],
        source: Source::Product,
        surface: Surface::Paper,
        forbidden: &[],
        hands: Hands::Beyond {
            why: "400 mm wide and without grips: no hand reaches around it",
        },
    })
}

fn steering_wheel() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("rim", Solid(0.9));
    s.hoop(
        &ellipse(DVec3::ZERO, DVec3::X * 176.0, DVec3::Y * 176.0, 48),
        DVec3::Z,
        [14.0, 14.0],
    );
    s.part("hub", Solid(0.7));
    s.at(v(0.0, 0.0, -15.0), DVec3::Z).stretched(1.2, 1.0, 1.0);
    s.lathe(&[[60.0, -15.0], [65.0, -5.0], [55.0, 15.0], [20.0, 22.0]]);
    s.at(DVec3::ZERO, DVec3::Y);
    for end in [v(176.0, 0.0, 0.0), v(-176.0, 0.0, 0.0), v(0.0, -176.0, 0.0)] {
        s.strap(&[end * 0.25 - DVec3::Z * 15.0, end], DVec3::Z, |_| [6.0, 14.0]);
    }
    s.finish(About {
        name: "steering-wheel",
        what: "A steering wheel taken off its column, upright",
        size_mm: [380.0, 380.0, 44.0],
        source: Source::Product,
        surface: Surface::Leather,
        forbidden: &[],
        hands: Hands::One,
    })
}
