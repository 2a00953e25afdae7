//! What lies on a desk: pens, paper, devices.

use glam::DVec3;

use super::v;
use crate::{
    about::{
        EverydayObject,
        Fill::{Skin, Solid},
        Hands, Source,
    },
    curves::{arc, ball, rod},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        pen(),
        pencil(),
        marker(),
        ruler(),
        book(),
        phone(),
        tablet(),
        laptop(),
        tv_remote(),
        game_controller(),
        computer_mouse(),
        torch(),
        camera(),
        headphones(),
    ]
}

fn pen() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("pen", Solid(0.011));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe_with(
        16,
        &[[0.5, -72.5], [2.0, -62.0], [4.5, -50.0], [4.5, 68.0], [3.0, 72.5]],
    );
    s.finish(About {
        name: "pen",
        what: "A ball-point pen, lying",
        size_mm: [145.0, 9.0, 9.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn pencil() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("pencil", Solid(0.005));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe_with(6, &[[0.4, -87.5], [3.9, -67.0], [3.9, 87.5]]);
    s.finish(About {
        name: "pencil",
        what: "A sharpened pencil of six sides, lying",
        size_mm: [175.0, 7.8, 6.8],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn marker() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("marker", Solid(0.02));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe(&[
        [7.5, -69.0],
        [8.5, -68.0],
        [8.5, 20.0],
        [9.0, 20.5],
        [9.0, 66.0],
        [7.0, 69.0],
    ]);
    s.finish(About {
        name: "marker",
        what: "A thick felt pen with its cap on, lying",
        size_mm: [138.0, 18.0, 18.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn ruler() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("ruler", Solid(0.025));
    s.slab([310.0, 2.5, 30.0], 0.0, 0.0);
    s.finish(About {
        name: "ruler",
        what: "A ruler of 30 cm, lying",
        size_mm: [310.0, 2.5, 30.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn book() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("book", Solid(0.35));
    s.slab([25.0, 210.0, 135.0], 0.0, 0.0);
    s.finish(About {
        name: "book",
        what: "A paperback, upright",
        size_mm: [25.0, 210.0, 135.0],
        source: Source::Product,
        surface: Surface::Paper,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn phone() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("phone", Solid(0.172));
    s.at(DVec3::ZERO, DVec3::Z).slab([71.5, 7.8, 147.0], 10.0, 2.0);
    s.finish(About {
        name: "phone",
        what: "A mobile phone, upright",
        size_mm: [71.5, 147.0, 7.8],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn tablet() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("tablet", Solid(0.48));
    s.at(DVec3::ZERO, DVec3::Z).slab([174.0, 6.5, 250.0], 12.0, 1.5);
    s.finish(About {
        name: "tablet",
        what: "A tablet computer, upright",
        size_mm: [174.0, 250.0, 6.5],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn laptop() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("laptop", Solid(1.3));
    s.at(DVec3::ZERO, DVec3::Z).slab([305.0, 16.0, 215.0], 10.0, 3.0);
    s.finish(About {
        name: "laptop",
        what: "A closed laptop, on its edge as it is carried",
        size_mm: [305.0, 215.0, 16.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn tv_remote() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("body", Solid(0.11));
    s.slab([190.0, 20.0, 46.0], 8.0, 5.0);
    s.part("keys", Solid(0.004));
    for row in 0..6 {
        for column in 0..3 {
            let [x, z] = [70.0 - 18.0 * f64::from(row), 13.0 * (f64::from(column) - 1.0)];
            s.at(v(x, 10.0, z), DVec3::Y)
                .lathe_with(12, &rod(4.0, [-1.0, 1.5]));
        }
    }
    s.finish(About {
        name: "tv-remote",
        what: "A remote control, lying; its keys are forbidden",
        size_mm: [190.0, 21.5, 46.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["keys"],
        hands: Hands::One,
    })
}

fn game_controller() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("body", Solid(0.17));
    s.slab([110.0, 38.0, 62.0], 20.0, 12.0);
    s.part("grips", Solid(0.1));
    for side in [-1.0, 1.0] {
        let path = [
            v(side * 45.0, 0.0, -14.0),
            v(side * 54.0, -2.0, 10.0),
            v(side * 60.0, -8.0, 35.0),
            v(side * 62.0, -16.0, 56.0),
            v(side * 62.0, -19.0, 63.0),
        ];
        s.tube(&path, DVec3::Y, |share| 18.0 - 11.0 * share.powi(4));
    }
    s.part("sticks", Solid(0.01));
    for side in [-1.0, 1.0] {
        s.at(v(side * 25.0, 18.0, 12.0), DVec3::Y).lathe_with(
            16,
            &[[4.0, -2.0], [4.0, 7.0], [8.5, 8.5], [8.5, 10.5], [7.0, 11.5]],
        );
    }
    s.finish(About {
        name: "game-controller",
        what: "A game controller, lying",
        size_mm: [154.0, 59.0, 97.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn computer_mouse() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("mouse", Solid(0.09));
    let mut profile: Vec<_> = ball(1.0)
        .into_iter()
        .filter(|&[_, height]| height > 0.0)
        .collect();
    profile.insert(0, [0.97, 0.0]);
    s.stretched(31.0, 38.0, 58.0).lathe(&profile);
    s.finish(About {
        name: "computer-mouse",
        what: "A computer mouse",
        size_mm: [61.0, 38.0, 114.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn torch() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("torch", Solid(0.16));
    s.at(DVec3::ZERO, DVec3::X);
    s.lathe(&[
        [11.5, -70.0],
        [13.5, -68.0],
        [13.5, 35.0],
        [19.0, 45.0],
        [19.0, 69.0],
        [18.0, 70.0],
    ]);
    s.finish(About {
        name: "torch",
        what: "A torch, lying",
        size_mm: [140.0, 38.0, 38.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn camera() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("body", Solid(0.45));
    s.slab([128.0, 92.0, 42.0], 8.0, 5.0);
    s.part("lens", Solid(0.2));
    s.at(v(5.0, -6.0, 15.0), DVec3::Z)
        .lathe(&[[32.0, 0.0], [34.0, 8.0], [34.0, 68.0], [31.0, 70.0]]);
    s.finish(About {
        name: "camera",
        what: "A camera with its lens; the lens is forbidden",
        size_mm: [128.0, 92.0, 106.0],
        source: Source::Product,
        surface: Surface::Rubber,
        forbidden: &["lens"],
        hands: Hands::One,
    })
}

fn headphones() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("band", Solid(0.07));
    let band = arc(DVec3::ZERO, 75.0, [-20.0, 200.0], 32, [DVec3::X, DVec3::Y]);
    s.strap(&band, DVec3::Z, |_| [14.0, 5.0]);
    s.part("cups", Skin(0.18));
    for side in [-1.0, 1.0] {
        s.at(v(side * 66.0, -45.0, 0.0), v(side, 0.15, 0.0))
            .stretched(1.0, 1.0, 0.85)
            .lathe(&[[35.0, -18.0], [42.0, -12.0], [42.0, 8.0], [34.0, 16.0]]);
    }
    s.finish(About {
        name: "headphones",
        what: "Headphones with a padded band",
        size_mm: [174.0, 168.0, 71.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}
