//! What is carried by a handle, a bail or a loop.

use glam::DVec3;

use super::v;
use crate::{
    about::{EverydayObject, Fill::Solid, Hands, Source},
    curves::{arc, rounded, vessel},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        lunch_box(),
        suitcase(),
        bucket(),
        shopping_bag(),
        backpack(),
        basket(),
        watering_can(),
        toolbox(),
    ]
}

fn lunch_box() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("box", Solid(1.45));
    s.slab([250.0, 180.0, 80.0], 12.0, 4.0);
    s.part("handle", Solid(0.05));
    let bar = [
        v(-60.0, 85.0, 0.0),
        v(-60.0, 145.0, 0.0),
        v(60.0, 145.0, 0.0),
        v(60.0, 85.0, 0.0),
    ];
    s.tube(&rounded(&bar, 15.0), DVec3::Z, |_| 8.0);
    s.finish(About {
        name: "lunch-box",
        what: "A filled lunch box with a carrying handle",
        size_mm: [250.0, 243.0, 80.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn suitcase() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("case", Solid(6.85));
    s.slab([550.0, 350.0, 200.0], 40.0, 20.0);
    s.part("handle", Solid(0.15));
    let bar = [
        v(-75.0, 165.0, 0.0),
        v(-70.0, 212.0, 0.0),
        v(70.0, 212.0, 0.0),
        v(75.0, 165.0, 0.0),
    ];
    s.strap(&rounded(&bar, 20.0), DVec3::Z, |_| [12.0, 9.0]);
    s.finish(About {
        name: "suitcase",
        what: "A packed suitcase with its handle up",
        size_mm: [550.0, 396.0, 200.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn bucket() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bucket", Solid(0.6));
    s.lathe(&vessel(&[[100.0, 0.0], [105.0, 5.0], [140.0, 268.0]], 4.0));
    s.part("water", Solid(4.0));
    s.lathe(&[[98.0, 6.0], [113.0, 120.0]]);
    s.part("bail", Solid(0.15));
    let bail = arc(v(0.0, 255.0, 0.0), 138.0, [0.0, 180.0], 24, [DVec3::X, DVec3::Y]);
    s.tube(&bail, DVec3::Z, |_| 3.0);
    s.part("grip", Solid(0.03));
    s.at(v(0.0, 393.0, 0.0), DVec3::X)
        .lathe(&[[11.0, -48.0], [12.0, -46.0], [12.0, 46.0], [11.0, 48.0]]);
    s.finish(About {
        name: "bucket",
        what: "A bucket with four litres of water, hanging by its bail",
        size_mm: [282.0, 405.0, 280.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["water"],
        hands: Hands::One,
    })
}

fn shopping_bag() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bag", Solid(4.0));
    let section = |y: f64, x: f64, z: f64| vec![v(x, y, -z), v(-x, y, -z), v(-x, y, z), v(x, y, z)];
    s.loft(&[
        section(0.0, 150.0, 75.0),
        section(200.0, 165.0, 85.0),
        section(330.0, 175.0, 45.0),
        section(380.0, 180.0, 20.0),
    ]);
    s.part("loops", Solid(0.03));
    for side in [-1.0, 1.0] {
        let loop_ = [
            v(-65.0, 350.0, side * 20.0),
            v(-55.0, 500.0, side * 8.0),
            v(0.0, 545.0, side * 4.0),
            v(55.0, 500.0, side * 8.0),
            v(65.0, 350.0, side * 20.0),
        ];
        s.strap(&rounded(&loop_, 35.0), DVec3::Z, |_| [1.5, 11.0]);
    }
    s.finish(About {
        name: "shopping-bag",
        what: "A filled cloth bag with two loops",
        size_mm: [360.0, 540.0, 170.0],
        source: Source::Product,
        surface: Surface::Cloth,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn backpack() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("sack", Solid(4.8));
    s.at(v(0.0, 220.0, 0.0), DVec3::Y)
        .slab([300.0, 440.0, 180.0], 60.0, 40.0);
    s.part("loop", Solid(0.02));
    let loop_ = [
        v(-50.0, 425.0, -60.0),
        v(-45.0, 488.0, -60.0),
        v(45.0, 488.0, -60.0),
        v(50.0, 425.0, -60.0),
    ];
    s.strap(&rounded(&loop_, 22.0), DVec3::Z, |_| [11.0, 3.0]);
    s.part("straps", Solid(0.2));
    for side in [-1.0, 1.0] {
        let strap = [
            v(side * 60.0, 410.0, -80.0),
            v(side * 80.0, 400.0, -125.0),
            v(side * 95.0, 250.0, -140.0),
            v(side * 105.0, 60.0, -115.0),
            v(side * 110.0, 40.0, -80.0),
        ];
        s.strap(&rounded(&strap, 25.0), DVec3::X, |_| [28.0, 5.0]);
    }
    s.finish(About {
        name: "backpack",
        what: "A filled backpack with a carrying loop",
        size_mm: [300.0, 491.0, 230.0],
        source: Source::Product,
        surface: Surface::Cloth,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn basket() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("basket", Solid(0.6));
    s.stretched(1.35, 1.0, 1.0);
    s.lathe(&vessel(&[[110.0, 0.0], [120.0, 10.0], [145.0, 150.0]], 8.0));
    s.part("contents", Solid(2.0));
    s.stretched(1.35, 1.0, 1.0);
    s.lathe(&[[108.0, 9.0], [125.0, 110.0]]);
    s.part("handle", Solid(0.15));
    let handle = arc(v(0.0, 135.0, 0.0), 140.0, [0.0, 180.0], 24, [DVec3::Z, DVec3::Y]);
    s.strap(&handle, DVec3::X, |_| [11.0, 8.0]);
    s.finish(About {
        name: "basket",
        what: "A filled basket with a bow over it",
        size_mm: [392.0, 283.0, 296.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["contents"],
        hands: Hands::One,
    })
}

fn watering_can() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("can", Solid(0.4));
    s.lathe(&vessel(&[[85.0, 0.0], [90.0, 5.0], [80.0, 200.0]], 4.0));
    s.part("water", Solid(2.0));
    s.lathe(&[[83.0, 5.0], [81.0, 95.0]]);
    s.part("spout", Solid(0.15));
    s.tube(
        &[v(75.0, 40.0, 0.0), v(240.0, 190.0, 0.0), v(290.0, 225.0, 0.0)],
        DVec3::Z,
        |share| 20.0 - 8.0 * share,
    );
    s.part("handle", Solid(0.15));
    let handle = [
        v(45.0, 195.0, 0.0),
        v(20.0, 300.0, 0.0),
        v(-110.0, 290.0, 0.0),
        v(-150.0, 130.0, 0.0),
        v(-82.0, 45.0, 0.0),
    ];
    s.strap(&rounded(&handle, 50.0), DVec3::Z, |_| [11.0, 9.0]);
    s.finish(About {
        name: "watering-can",
        what: "A watering can with two litres",
        size_mm: [447.0, 305.0, 180.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &["water"],
        hands: Hands::One,
    })
}

fn toolbox() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("box", Solid(5.0));
    s.at(v(0.0, 75.0, 0.0), DVec3::Y)
        .slab([400.0, 150.0, 200.0], 10.0, 5.0);
    s.part("handle", Solid(0.4));
    for x in [-150.0, 150.0] {
        s.at(v(x, 180.0, 0.0), DVec3::Y)
            .slab([14.0, 80.0, 40.0], 0.0, 0.0);
    }
    s.at(v(0.0, 205.0, 0.0), DVec3::X)
        .lathe(&[[14.0, -155.0], [15.0, -150.0], [15.0, 150.0], [14.0, 155.0]]);
    s.finish(About {
        name: "toolbox",
        what: "A filled toolbox with a bar to carry it",
        size_mm: [400.0, 220.0, 200.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}
