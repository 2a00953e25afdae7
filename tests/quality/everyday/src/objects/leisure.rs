//! Sports gear, instruments, a sword.

use glam::DVec3;
use grasp_mesh_builder::sin_cos_degrees;

use super::v;
use crate::{
    about::{
        EverydayObject,
        Fill::{Skin, Solid},
        Hands, Source,
    },
    curves::{ellipse, rod},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        hoop(),
        fishing_rod(),
        sword(),
        baseball_bat(),
        tennis_racket(),
        golf_club(),
        frisbee(),
        guitar(),
        violin_bow(),
        flute(),
    ]
}

fn hoop() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("hoop", Solid(0.45));
    s.hoop(
        &ellipse(DVec3::ZERO, DVec3::X * 440.0, DVec3::Y * 440.0, 72),
        DVec3::Z,
        [10.0, 10.0],
    );
    s.finish(About {
        name: "hoop",
        what: "A gymnastic hoop, upright",
        size_mm: [900.0, 900.0, 20.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn fishing_rod() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("grip", Solid(0.1));
    s.lathe(&[[12.0, 0.0], [14.0, 8.0], [12.0, 300.0], [8.0, 340.0]]);
    s.part("rod", Solid(0.1));
    s.lathe_with(8, &[[6.0, 330.0], [4.0, 1200.0], [1.0, 2400.0]]);
    s.part("reel", Solid(0.25));
    s.at(v(28.0, 330.0, 0.0), DVec3::X).lathe(&[
        [8.0, -20.0],
        [8.0, 15.0],
        [24.0, 20.0],
        [24.0, 50.0],
        [18.0, 55.0],
    ]);
    s.finish(About {
        name: "fishing-rod",
        what: "A fishing rod with its reel, upright",
        size_mm: [97.0, 2400.0, 48.0],
        source: Source::Product,
        surface: Surface::Rubber,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn sword() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("hilt", Solid(0.35));
    s.stretched(1.0, 1.0, 0.8);
    s.lathe(&[
        [10.0, -150.0],
        [22.0, -142.0],
        [22.0, -125.0],
        [11.0, -118.0],
        [15.0, -60.0],
        [12.0, 0.0],
    ]);
    s.part("guard", Solid(0.2));
    s.at(v(0.0, 5.0, 0.0), DVec3::X)
        .lathe(&[[9.0, -100.0], [7.0, 0.0], [9.0, 100.0]]);
    s.part("blade", Solid(0.65));
    let section =
        |y: f64, half: f64| vec![v(half, y, 0.0), v(0.0, y, -2.5), v(-half, y, 0.0), v(0.0, y, 2.5)];
    s.loft(&[section(5.0, 24.0), section(650.0, 16.0), vec![v(0.0, 780.0, 0.0)]]);
    s.finish(About {
        name: "sword",
        what: "A sword with its point up; blade and guard are forbidden",
        size_mm: [200.0, 930.0, 36.0],
        source: Source::Product,
        surface: Surface::Leather,
        forbidden: &["blade", "guard"],
        hands: Hands::One,
    })
}

fn baseball_bat() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bat", Solid(0.9));
    s.lathe(&[
        [22.0, 0.0],
        [25.0, 4.0],
        [24.0, 14.0],
        [13.0, 25.0],
        [12.5, 200.0],
        [18.0, 400.0],
        [33.0, 640.0],
        [33.0, 820.0],
        [25.0, 840.0],
    ]);
    s.finish(About {
        name: "baseball-bat",
        what: "A baseball bat with its knob below",
        size_mm: [66.0, 840.0, 66.0],
        source: Source::Standard,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn tennis_racket() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.14));
    s.lathe_with(
        8,
        &[
            [18.0, 0.0],
            [18.0, 8.0],
            [16.0, 12.0],
            [16.0, 190.0],
            [13.0, 200.0],
        ],
    );
    s.part("frame", Solid(0.14));
    s.hoop(
        &ellipse(v(0.0, 510.0, 0.0), DVec3::X * 124.0, DVec3::Y * 164.0, 40),
        DVec3::Z,
        [11.0, 7.0],
    );
    for side in [-1.0, 1.0] {
        s.tube(
            &[v(side * 4.0, 190.0, 0.0), v(side * 50.0, 360.0, 0.0)],
            DVec3::Z,
            |_| 8.5,
        );
    }
    s.part("strings", Solid(0.02));
    s.at(v(0.0, 510.0, 0.0), DVec3::Z).stretched(124.0, 1.0, 164.0);
    s.lathe(&[[1.0, -0.7], [1.0, 0.7]]);
    s.finish(About {
        name: "tennis-racket",
        what: "A tennis racket with its grip below; its strings are forbidden",
        size_mm: [262.0, 681.0, 36.0],
        source: Source::Standard,
        surface: Surface::Rubber,
        forbidden: &["strings"],
        hands: Hands::One,
    })
}

fn golf_club() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("grip", Solid(0.05));
    s.lathe(&[[9.0, 700.0], [14.0, 970.0]]);
    s.part("shaft", Solid(0.1));
    s.lathe_with(12, &[[4.5, 10.0], [7.5, 720.0]]);
    s.part("head", Solid(0.25));
    s.at(v(32.0, 18.0, 0.0), DVec3::Y)
        .slab([80.0, 36.0, 18.0], 8.0, 3.0);
    s.finish(About {
        name: "golf-club",
        what: "An iron of golf, its head below",
        size_mm: [86.0, 970.0, 28.0],
        source: Source::Product,
        surface: Surface::Rubber,
        forbidden: &["head"],
        hands: Hands::One,
    })
}

fn frisbee() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("disc", Solid(0.175));
    s.lathe(&[
        [0.0, 28.0],
        [95.0, 26.0],
        [128.0, 17.0],
        [131.0, 0.0],
        [135.0, 1.0],
        [136.5, 10.0],
        [131.0, 20.0],
        [98.0, 29.0],
        [0.0, 32.0],
    ]);
    s.finish(About {
        name: "frisbee",
        what: "A frisbee, lying",
        size_mm: [273.0, 32.0, 273.0],
        source: Source::Standard,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn guitar() -> EverydayObject {
    const STEPS: usize = 40;
    let mut s = Sketch::new();
    s.part("body", Skin(1.3));
    // Wide below, narrow at the waist, less wide above: by the distance from the middle of the waist.
    let outline = |inset: f64, z: f64| {
        let around = |step: usize| {
            let angle = 360.0 * step as f64 / STEPS as f64;
            let [(sin, cos), (_, twice), (_, fourfold)] = [1.0, 2.0, 4.0].map(|n| sin_cos_degrees(n * angle));
            let radius = 205.7 - 60.0 * twice - 20.7 * fourfold - 54.0 * sin * cos * cos - inset;
            v(radius * cos, radius * sin, z)
        };
        (0..STEPS).map(around).collect::<Vec<_>>()
    };
    s.loft(&[
        outline(4.0, -50.0),
        outline(0.0, -46.0),
        outline(0.0, 46.0),
        outline(4.0, 50.0),
    ]);
    s.part("neck", Solid(0.45));
    s.strap(
        &[v(0.0, 200.0, 46.0), v(0.0, 245.0, 46.0), v(0.0, 630.0, 46.0)],
        DVec3::Z,
        |share| [12.0 - 2.0 * share, 29.0 - 6.0 * share],
    );
    s.part("head", Solid(0.15));
    s.at(v(0.0, 705.0, 44.0), DVec3::Y)
        .slab([76.0, 160.0, 16.0], 0.0, 0.0);
    s.part("pegs", Solid(0.1));
    for y in [655.0, 705.0, 755.0] {
        s.at(v(0.0, y, 40.0), DVec3::X).lathe_with(
            12,
            &[
                [7.0, -62.0],
                [7.0, -50.0],
                [3.0, -48.0],
                [3.0, 48.0],
                [7.0, 50.0],
                [7.0, 62.0],
            ],
        );
    }
    s.finish(About {
        name: "guitar",
        what: "A guitar, upright on its body",
        size_mm: [362.0, 1030.0, 108.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn violin_bow() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("stick", Solid(0.038));
    s.at(DVec3::ZERO, DVec3::X)
        .lathe_with(12, &[[4.3, 0.0], [4.3, 120.0], [3.5, 400.0], [2.7, 735.0]]);
    s.part("frog", Solid(0.018));
    s.at(v(40.0, -12.0, 0.0), DVec3::Y)
        .slab([48.0, 20.0, 12.0], 0.0, 0.0);
    s.part("hair", Solid(0.005));
    s.at(v(380.0, -21.0, 0.0), DVec3::Y)
        .slab([690.0, 1.5, 9.0], 0.0, 0.0);
    s.part("tip", Solid(0.002));
    s.at(v(728.0, -11.0, 0.0), DVec3::Y)
        .slab([14.0, 22.0, 8.0], 0.0, 0.0);
    s.finish(About {
        name: "violin-bow",
        what: "The bow of a violin, lying; its hair is forbidden",
        size_mm: [735.0, 26.3, 12.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["hair"],
        hands: Hands::One,
    })
}

fn flute() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("tube", Solid(0.4));
    s.at(DVec3::ZERO, DVec3::X)
        .lathe(&[[8.0, -335.0], [9.5, -333.0], [9.5, 333.0], [8.0, 335.0]]);
    s.part("keys", Solid(0.05));
    for key in 0..12 {
        s.at(v(-80.0 + 27.0 * f64::from(key), 8.0, 0.0), DVec3::Y)
            .lathe_with(12, &rod(7.0, [-1.0, 4.0]));
    }
    s.finish(About {
        name: "flute",
        what: "A flute, lying",
        size_mm: [670.0, 21.5, 19.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}
