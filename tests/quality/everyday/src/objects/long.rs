//! What is long or wide: brooms, umbrellas, sticks.

use glam::DVec3;
use grasp_mesh_builder::sin_cos_degrees;

use super::v;
use crate::{
    about::{
        EverydayObject,
        Fill::{Skin, Solid},
        Hands, Source,
    },
    curves::{arc, rod, rounded},
    sketch::{About, Sketch},
    surface::Surface,
};

pub(super) fn objects() -> Vec<EverydayObject> {
    vec![
        broom(),
        rake(),
        shovel(),
        umbrella_closed(),
        umbrella_open(),
        crutch(),
        walking_stick(),
        stick(),
        stick_with_bar(),
        flag(),
    ]
}

fn broom() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.5));
    s.lathe(&rod(12.0, [35.0, 1400.0]));
    s.part("head", Solid(0.3));
    s.at(v(0.0, 75.0, 0.0), DVec3::Y)
        .slab([300.0, 40.0, 60.0], 0.0, 0.0);
    s.part("bristles", Solid(0.1));
    s.at(v(0.0, 30.0, 0.0), DVec3::Y)
        .slab([310.0, 60.0, 70.0], 0.0, 0.0);
    s.finish(About {
        name: "broom",
        what: "A broom, upright; its bristles are forbidden",
        size_mm: [310.0, 1400.0, 70.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["bristles"],
        hands: Hands::One,
    })
}

fn rake() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("handle", Solid(0.7));
    s.lathe(&rod(14.0, [80.0, 1600.0]));
    s.part("head", Solid(0.5));
    s.at(v(0.0, 85.0, 0.0), DVec3::Y)
        .slab([400.0, 20.0, 20.0], 0.0, 0.0);
    for tine in 0..14 {
        let x = 29.0 * (f64::from(tine) - 6.5);
        s.at(v(x, 0.0, 0.0), DVec3::Y)
            .lathe_with(8, &[[1.5, 0.0], [3.5, 15.0], [3.5, 80.0]]);
    }
    s.finish(About {
        name: "rake",
        what: "A garden rake, upright; its head is forbidden",
        size_mm: [400.0, 1600.0, 28.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["head"],
        hands: Hands::One,
    })
}

fn shovel() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("shaft", Solid(0.7));
    s.lathe(&rod(16.0, [250.0, 1000.0]));
    s.part("grip", Solid(0.15));
    let grip = [
        v(-16.0, 985.0, 0.0),
        v(-65.0, 1100.0, 0.0),
        v(65.0, 1100.0, 0.0),
        v(16.0, 985.0, 0.0),
    ];
    s.tube(&rounded(&grip, 20.0), DVec3::Z, |_| 13.0);
    s.part("blade", Solid(1.0));
    let section =
        |y: f64, half: f64| vec![v(half, y, 0.0), v(0.0, y, -2.0), v(-half, y, 0.0), v(0.0, y, 2.0)];
    s.loft(&[
        section(0.0, 60.0),
        section(80.0, 110.0),
        section(280.0, 115.0),
        section(300.0, 30.0),
    ]);
    s.finish(About {
        name: "shovel",
        what: "A spade with a D-shaped grip, upright; its blade is forbidden",
        size_mm: [230.0, 1113.0, 32.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &["blade"],
        hands: Hands::One,
    })
}

/// The crook of a stick whose shaft ends at `height`, bending toward +x.
fn crook(height: f64, radius: f64) -> Vec<DVec3> {
    let mut path = vec![v(0.0, height - 60.0, 0.0), v(0.0, height - 30.0, 0.0)];
    path.extend(arc(
        v(radius, height, 0.0),
        radius,
        [180.0, -10.0],
        16,
        [DVec3::X, DVec3::Y],
    ));
    path
}

fn umbrella_closed() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("canopy", Solid(0.25));
    s.lathe(&[
        [5.0, 60.0],
        [14.0, 90.0],
        [27.0, 550.0],
        [22.0, 620.0],
        [7.0, 640.0],
    ]);
    s.part("shaft", Solid(0.1));
    s.lathe_with(12, &rod(5.0, [0.0, 780.0]));
    s.part("crook", Solid(0.1));
    s.tube(&crook(810.0, 40.0), DVec3::Z, |_| 11.0);
    s.finish(About {
        name: "umbrella-closed",
        what: "A closed umbrella with a crook, hanging",
        size_mm: [118.0, 861.0, 54.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn umbrella_open() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("canopy", Skin(0.25));
    s.lathe(&[
        [220.0, 795.0],
        [400.0, 715.0],
        [500.0, 615.0],
        [502.0, 616.0],
        [402.0, 718.0],
        [222.0, 798.0],
        [0.0, 828.0],
    ]);
    s.part("shaft", Solid(0.1));
    s.lathe_with(12, &rod(5.0, [50.0, 880.0]));
    s.part("handle", Solid(0.1));
    s.lathe(&[[10.0, -60.0], [14.0, -50.0], [12.0, 40.0], [8.0, 60.0]]);
    s.finish(About {
        name: "umbrella-open",
        what: "An open umbrella; its canopy is forbidden",
        size_mm: [1004.0, 940.0, 1004.0],
        source: Source::Product,
        surface: Surface::Rubber,
        forbidden: &["canopy"],
        hands: Hands::One,
    })
}

fn crutch() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("shaft", Solid(0.35));
    s.tube(
        &rounded(
            &[v(0.0, 0.0, 0.0), v(0.0, 720.0, 0.0), v(-40.0, 940.0, 0.0)],
            60.0,
        ),
        DVec3::Z,
        |_| 11.0,
    );
    s.part("grip", Solid(0.12));
    s.at(v(0.0, 730.0, 0.0), DVec3::X).lathe(&[
        [15.0, -15.0],
        [16.0, -10.0],
        [14.0, 60.0],
        [17.0, 118.0],
        [14.0, 122.0],
    ]);
    s.part("cuff", Solid(0.1));
    let cuff = arc(
        v(20.0, 930.0, 0.0),
        56.0,
        [50.0, 310.0],
        20,
        [DVec3::X, DVec3::NEG_Z],
    );
    s.strap(&cuff, DVec3::Y, |_| [35.0, 3.0]);
    s.finish(About {
        name: "crutch",
        what: "A forearm crutch",
        size_mm: [173.0, 965.0, 118.0],
        source: Source::Product,
        surface: Surface::Rubber,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn walking_stick() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("stick", Solid(0.28));
    s.lathe(&rod(10.0, [0.0, 850.0]));
    s.part("crook", Solid(0.1));
    s.tube(&crook(850.0, 45.0), DVec3::Z, |_| 11.0);
    s.finish(About {
        name: "walking-stick",
        what: "A walking stick with a crook",
        size_mm: [112.0, 906.0, 22.0],
        source: Source::Product,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn stick() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("stick", Solid(0.8));
    s.lathe(&rod(12.5, [0.0, 1300.0]));
    s.finish(About {
        name: "stick",
        what: "A stick of 1.3 m, upright",
        size_mm: [25.0, 1300.0, 25.0],
        source: Source::Typical,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn stick_with_bar() -> EverydayObject {
    let mut s = Sketch::new();
    s.part("stick", Solid(0.7));
    s.lathe(&rod(12.5, [0.0, 1300.0]));
    s.part("bar", Solid(0.1));
    s.at(v(0.0, 1280.0, 0.0), DVec3::X)
        .lathe(&rod(9.0, [-150.0, 150.0]));
    s.finish(About {
        name: "stick-with-bar",
        what: "A stick of 1.3 m with a bar across its upper end",
        size_mm: [300.0, 1300.0, 25.0],
        source: Source::Typical,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}

fn flag() -> EverydayObject {
    const COLUMNS: usize = 12;
    let mut s = Sketch::new();
    s.part("pole", Solid(0.4));
    s.lathe_with(16, &rod(9.0, [0.0, 1200.0]));
    s.part("cloth", Skin(0.05));
    let row = |y: f64| {
        let across = |column: usize| {
            let share = column as f64 / COLUMNS as f64;
            let (wave, _) = sin_cos_degrees(540.0 * share);
            v(9.0 + 600.0 * share, y, 35.0 * share * wave)
        };
        (0..=COLUMNS).map(across).collect::<Vec<_>>()
    };
    s.sheet(&[row(780.0), row(980.0), row(1180.0)]);
    s.finish(About {
        name: "flag",
        what: "A flag on its pole; the cloth has no thickness",
        size_mm: [618.0, 1200.0, 46.7],
        source: Source::Typical,
        surface: Surface::Wood,
        forbidden: &[],
        hands: Hands::One,
    })
}
