//! What stands on a laid table: vessels, plates, cutlery.

use glam::DVec3;

use super::v;
use crate::{
    about::{
        EverydayObject,
        Fill::{Skin, Solid},
        Hands, Source,
    },
    curves::{arc, ellipse, rounded, vessel},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        mug(),
        tumbler(),
        wine_glass(),
        plate(),
        bowl(),
        table_knife(),
        fork(),
        spoon(),
        small_bottle(),
        large_bottle(),
        wine_bottle(),
        can(),
        jar(),
        milk_carton(),
        salt_shaker(),
        candle(),
        tray(),
    ]
}

fn mug() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("cup", Solid(0.31));
    s.lathe(&vessel(&[[36.0, 0.0], [41.0, 4.0], [41.0, 95.0]], 4.0));
    s.part("handle", Solid(0.04));
    let handle = arc(v(36.5, 50.0, 0.0), 34.0, [-85.0, 85.0], 16, [DVec3::X, DVec3::Y]);
    s.strap(&handle, DVec3::Z, |_| [7.0, 4.5]);
    s.finish(About {
        name: "mug",
        what: "An empty mug with its handle",
        size_mm: [116.0, 95.0, 82.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn tumbler() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("glass", Solid(0.25));
    s.lathe(&vessel(&[[29.0, 0.0], [31.0, 2.0], [39.0, 120.0]], 3.0));
    s.finish(About {
        name: "tumbler",
        what: "An empty glass",
        size_mm: [78.0, 120.0, 78.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn wine_glass() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("glass", Solid(0.17));
    s.lathe(&[
        [36.0, 0.0],
        [36.5, 1.5],
        [12.0, 5.0],
        [4.0, 14.0],
        [3.8, 85.0],
        [9.0, 93.0],
        [30.0, 110.0],
        [41.0, 140.0],
        [39.0, 175.0],
        [33.0, 210.0],
        [32.0, 210.0],
        [38.0, 175.0],
        [39.8, 140.0],
        [29.0, 112.0],
        [0.0, 98.0],
    ]);
    s.finish(About {
        name: "wine-glass",
        what: "A wine glass",
        size_mm: [82.0, 210.0, 82.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn plate() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("plate", Solid(0.65));
    s.lathe(&[
        [75.0, 0.0],
        [90.0, 3.0],
        [134.0, 20.0],
        [135.0, 22.0],
        [133.0, 25.0],
        [92.0, 10.0],
        [75.0, 6.0],
    ]);
    s.finish(About {
        name: "plate",
        what: "A dinner plate",
        size_mm: [270.0, 25.0, 270.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn bowl() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bowl", Solid(0.38));
    s.lathe(&vessel(
        &[[35.0, 0.0], [50.0, 12.0], [68.0, 40.0], [75.0, 68.0]],
        5.0,
    ));
    s.finish(About {
        name: "bowl",
        what: "A cereal bowl",
        size_mm: [150.0, 68.0, 150.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

/// Half the thickness and half the width of a piece of cutlery's handle; the share goes from its end to its neck.
fn cutlery_handle(share: f64) -> [f64; 2] {
    [1.5 + 0.5 * share, 10.0 - 6.5 * share]
}

fn table_knife() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.055));
    let handle: Vec<_> = (0..=8)
        .map(|i| v(-115.0 + 14.0 * f64::from(i), 0.0, 0.0))
        .collect();
    s.strap(&handle, DVec3::Y, |share| [4.0 - share, 9.0 - 2.5 * share]);
    s.part("blade", Solid(0.025));
    s.at(v(54.0, 0.0, 0.0), DVec3::Y)
        .slab([122.0, 1.8, 20.0], 8.0, 0.0);
    s.finish(About {
        name: "table-knife",
        what: "A table knife, lying; its blade is forbidden",
        size_mm: [230.0, 8.0, 20.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &["blade"],
        hands: Hands::One,
    })
}

fn fork() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.03));
    let handle: Vec<_> = (0..=10)
        .map(|i| v(-100.0 + 13.0 * f64::from(i), 0.0, 0.0))
        .collect();
    s.strap(&handle, DVec3::Y, cutlery_handle);
    s.part("head", Solid(0.02));
    let root = [v(25.0, 0.0, 0.0), v(38.0, -2.0, 0.0), v(50.0, -3.0, 0.0)];
    s.strap(&root, DVec3::Y, |share| [1.5, 4.0 + 8.0 * share]);
    for tine in 0..4 {
        let z = 6.6 * (f64::from(tine) - 1.5);
        let path = [v(47.0, -3.0, z), v(75.0, -2.0, z), v(95.0, 5.0, z)];
        s.tube(&path, DVec3::Z, |share| 1.6 - 0.8 * share);
    }
    s.finish(About {
        name: "fork",
        what: "A table fork, lying; its tines are forbidden",
        size_mm: [195.0, 10.0, 24.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &["head"],
        hands: Hands::One,
    })
}

fn spoon() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.03));
    let handle: Vec<_> = (0..=10)
        .map(|i| v(-100.0 + 13.0 * f64::from(i), 0.0, 0.0))
        .collect();
    s.strap(&handle, DVec3::Y, cutlery_handle);
    s.part("bowl", Solid(0.02));
    s.at(v(61.0, 4.0, 0.0), DVec3::Y)
        .stretched(1.5, 1.0, 1.0)
        .lathe(&vessel(&[[8.0, -9.0], [16.0, -6.0], [22.0, 0.0]], 2.0));
    s.finish(About {
        name: "spoon",
        what: "A table spoon, lying; its bowl is forbidden",
        size_mm: [194.0, 9.0, 44.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &["bowl"],
        hands: Hands::One,
    })
}

fn small_bottle() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bottle", Solid(0.53));
    s.lathe(&[
        [28.0, 0.0],
        [32.5, 5.0],
        [32.5, 70.0],
        [30.5, 85.0],
        [32.5, 100.0],
        [32.5, 135.0],
        [24.0, 170.0],
        [13.5, 188.0],
        [13.5, 195.0],
        [15.0, 196.0],
        [15.0, 214.0],
        [14.0, 215.0],
    ]);
    s.finish(About {
        name: "small-bottle",
        what: "A full bottle of half a litre",
        size_mm: [65.0, 215.0, 65.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn large_bottle() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bottle", Solid(1.54));
    s.lathe(&[
        [38.0, 0.0],
        [44.0, 6.0],
        [44.0, 100.0],
        [40.0, 125.0],
        [44.0, 150.0],
        [44.0, 210.0],
        [30.0, 265.0],
        [14.0, 292.0],
        [13.5, 300.0],
        [15.0, 301.0],
        [15.0, 319.0],
        [14.0, 320.0],
    ]);
    s.finish(About {
        name: "large-bottle",
        what: "A full bottle of one and a half litres",
        size_mm: [88.0, 320.0, 88.0],
        source: Source::Product,
        surface: Surface::Plastic,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn wine_bottle() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("bottle", Solid(1.25));
    s.lathe(&[
        [34.0, 0.0],
        [37.5, 4.0],
        [37.5, 185.0],
        [33.0, 205.0],
        [17.0, 225.0],
        [14.0, 245.0],
        [13.5, 280.0],
        [15.0, 283.0],
        [15.0, 296.0],
        [14.0, 300.0],
    ]);
    s.finish(About {
        name: "wine-bottle",
        what: "A full bottle of wine",
        size_mm: [75.0, 300.0, 75.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn can() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("can", Solid(0.35));
    s.lathe(&[
        [25.0, 0.0],
        [33.0, 9.0],
        [33.0, 103.0],
        [27.0, 113.0],
        [27.0, 115.0],
    ]);
    s.finish(About {
        name: "can",
        what: "A full can of a third of a litre",
        size_mm: [66.0, 115.0, 66.0],
        source: Source::Product,
        surface: Surface::Metal,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn jar() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("jar", Solid(0.6));
    s.lathe(&[[35.0, 0.0], [38.0, 4.0], [38.0, 75.0], [32.0, 83.0], [32.0, 90.0]]);
    s.part("lid", Solid(0.02));
    s.lathe(&[[34.0, 86.0], [35.0, 87.0], [35.0, 99.0], [34.0, 100.0]]);
    s.finish(About {
        name: "jar",
        what: "A full jam jar with its lid",
        size_mm: [76.0, 100.0, 76.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn milk_carton() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("carton", Solid(1.06));
    s.at(v(0.0, 97.5, 0.0), DVec3::Y)
        .slab([70.0, 195.0, 74.0], 0.0, 0.0);
    s.part("cap", Solid(0.003));
    s.at(v(0.0, 190.0, 15.0), DVec3::Y)
        .lathe(&[[15.0, 0.0], [15.0, 16.0], [14.0, 17.0]]);
    s.finish(About {
        name: "milk-carton",
        what: "A full carton of one litre",
        size_mm: [70.0, 207.0, 74.0],
        source: Source::Product,
        surface: Surface::Paper,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn salt_shaker() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("shaker", Solid(0.12));
    s.lathe(&[
        [20.0, 0.0],
        [22.0, 3.0],
        [16.0, 45.0],
        [17.0, 52.0],
        [15.0, 68.0],
        [8.0, 75.0],
    ]);
    s.finish(About {
        name: "salt-shaker",
        what: "A salt shaker",
        size_mm: [44.0, 75.0, 44.0],
        source: Source::Product,
        surface: Surface::Glass,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn candle() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("candle", Solid(0.07));
    s.lathe(&[[11.0, 0.0], [11.0, 190.0], [8.0, 198.0], [1.5, 200.0]]);
    s.part("wick", Solid(0.0002));
    s.lathe_with(8, &[[0.8, 195.0], [0.8, 210.0]]);
    s.finish(About {
        name: "candle",
        what: "A candle; its wick is forbidden",
        size_mm: [22.0, 210.0, 22.0],
        source: Source::Product,
        surface: Surface::Natural,
        forbidden: &["wick"],
        hands: Hands::One,
    })
}

fn tray() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("base", Solid(0.8));
    s.stretched(219.0, 1.0, 144.0).lathe(&[[1.0, 0.0], [1.0, 6.0]]);
    s.part("rim", Solid(0.25));
    s.hoop(
        &ellipse(v(0.0, 16.0, 0.0), DVec3::X * 219.0, DVec3::NEG_Z * 144.0, 48),
        DVec3::Y,
        [16.0, 4.0],
    );
    s.part("handles", Solid(0.1));
    for side in [-1.0, 1.0] {
        let x = side * 219.0;
        let grip = [
            v(x, 24.0, -60.0),
            v(x, 48.0, -50.0),
            v(x, 48.0, 50.0),
            v(x, 24.0, 60.0),
        ];
        s.tube(&rounded(&grip, 15.0), DVec3::X, |_| 6.0);
    }
    s.part("dishes", Skin(1.2));
    s.at(v(0.0, 6.0, 0.0), DVec3::Y);
    s.lathe(&[[60.0, 0.0], [100.0, 15.0], [98.0, 18.0], [60.0, 4.0]]);
    s.finish(About {
        name: "tray",
        what: "An oval tray with two handles and dishes on it",
        size_mm: [450.0, 54.0, 300.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["dishes"],
        hands: Hands::Beyond {
            why: "2.4 kg, centred 22 cm from either handle: 5 N m, and it must stay level",
        },
    })
}
