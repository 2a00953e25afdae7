//! The tables that show soonest that two hands meet: which spheres inside a hand to compare first, and which of a giver's
//! solids. They are part of `grasp-synthesis`.
//!
//! Each table is a greedy cover: its next member is the one that settles most of the pairs that those before it leave. The
//! pairs are known grips of the built-in objects and givers, who hold the object by other known grips, that meet. Any order
//! gives the same answers; a good one gives them sooner.

use std::fmt::Write as _;

use grasp_assets::{atlas_folder::complete_atlas, hands::hand, objects::objects};
use grasp_synthesis::{
    known::atlas::Atlas,
    model::hand::{Handedness, joints::HandJoints, rig::Rig},
    physical::{
        grip::GIVER_CLEARANCE,
        solids::{PreparedHand, SPHERES, TaperedCapsule, TrackedSolids},
    },
};
use rayon::prelude::*;

use crate::AssetFile;

/// Givers per object.
const GIVERS: usize = 48;

/// Grips per giver.
const GRIPS: usize = 400;

/// Where along a solid's axis spheres may be.
const ALONG: [f32; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];

/// Paths below the assets folder.
const SPHERES_PATH: &str = "../server/synthesis/src/known/inner_spheres/tables.rs";
const ORDER_PATH: &str = "../server/synthesis/src/physical/solids/prepared_hand/collision_order.rs";

/// A known grip and a giver that meet.
struct Pair {
    giver: PreparedHand,
    giver_solids: TrackedSolids,
    grip: TrackedSolids,
}

/// The tables as Rust.
pub(crate) fn generate() -> Vec<AssetFile> {
    let rig = &hand("adult", Handedness::Right).expect("the rig is built in").rig;
    let pairs: Vec<Pair> = objects()
        .iter()
        .flat_map(|object| pairs(&complete_atlas(object.name, rig), rig))
        .collect();
    vec![
        (SPHERES_PATH.to_owned(), inner_spheres(&pairs).into_bytes()),
        (ORDER_PATH.to_owned(), collision_order(&pairs).into_bytes()),
    ]
}

/// Those that meet of evenly chosen grips and givers of an atlas.
fn pairs(known: &Atlas, rig: &Rig) -> Vec<Pair> {
    let count = known.entries().len();
    (0..GIVERS)
        .into_par_iter()
        .flat_map_iter(|giver| {
            let pose = &known.entries()[giver * count / GIVERS].grip.pose;
            let giver_solids = TrackedSolids::of_joints(&HandJoints::of_pose(rig, pose));
            let giver = PreparedHand::new(&giver_solids);
            let pair = |grip: usize| {
                let solids = known.entries()[grip * count / GRIPS].tracked_solids(rig);
                let meets = giver.clearance(&solids, GIVER_CLEARANCE).is_none();
                meets.then(|| Pair {
                    giver: giver.clone(),
                    giver_solids,
                    grip: solids,
                })
            };
            (0..GRIPS).filter_map(pair).collect::<Vec<_>>()
        })
        .collect()
}

/// Members in the order of a greedy cover, and the share of pairs that each and those before it settle. `settles` says of a
/// member which pairs it settles.
fn cover(length: usize, settles: &[Vec<bool>]) -> (Vec<usize>, Vec<f64>) {
    let pairs = settles[0].len();
    let mut is_open = vec![true; pairs];
    let (mut order, mut settled) = (Vec::new(), Vec::new());
    while order.len() < length {
        let gain = |member: &usize| {
            let both = settles[*member].iter().zip(&is_open);
            both.filter(|(settles, open)| **settles && **open).count()
        };
        // Of members that settle as many, the first.
        let left = (0..settles.len()).rev().filter(|member| !order.contains(member));
        let Some(best) = left.max_by_key(gain) else { break };
        for (open, settles) in is_open.iter_mut().zip(&settles[best]) {
            *open &= !settles;
        }
        order.push(best);
        let open = is_open.iter().filter(|open| **open).count();
        settled.push(1.0 - open as f64 / pairs.max(1) as f64);
    }
    (order, settled)
}

/// The inner spheres of [`SPHERES_PATH`].
fn inner_spheres(pairs: &[Pair]) -> String {
    let solids = pairs[0].grip.hand.iter().count();
    let spheres: Vec<(usize, f32)> = (0..solids)
        .flat_map(|solid| ALONG.map(|along| (solid, along)))
        .collect();
    let settles: Vec<Vec<bool>> = spheres
        .par_iter()
        .map(|&(solid, along)| {
            let settles = |pair: &Pair| {
                let solid: Option<&TaperedCapsule> = pair.grip.hand.iter().nth(solid);
                solid.is_some_and(|solid| {
                    let (middle, radius) = (solid.at(along), solid.radius_at(along));
                    pair.giver.certainly_within(middle, radius, GIVER_CLEARANCE)
                })
            };
            pairs.iter().map(settles).collect()
        })
        .collect();
    let (order, settled) = cover(2 * SPHERES, &settles);
    let missed = |count: usize| 100.0 * (1.0 - settled[count - 1]);
    let mut text = String::from(
        "//! Which spheres inside a hand detect most collisions of two hands: written by `grasp-assets-generator screens`, not by\n\
         //! hand.\n\n\
         use super::InnerSphere;\n\
         use crate::physical::solids::SPHERES;\n",
    );
    let _ = write!(
        text,
        "\n/// They miss {:.1} % of the collisions of known grips and givers.\n",
        missed(SPHERES)
    );
    text += &table("FIRST", &spheres, &order[..SPHERES]);
    let _ = write!(
        text,
        "\n/// With these as well, {:.1} % are missed.\n",
        missed(2 * SPHERES)
    );
    text += &table("SECOND", &spheres, &order[SPHERES..]);
    text
}

/// Spheres as a constant.
fn table(name: &str, spheres: &[(usize, f32)], chosen: &[usize]) -> String {
    let mut text = format!("pub(super) const {name}: [InnerSphere; SPHERES] = [\n");
    for &sphere in chosen {
        let (solid, along) = spheres[sphere];
        let _ = writeln!(text, "    ({solid}, {along:?}),");
    }
    text + "];\n"
}

/// The order of a giver's solids of [`ORDER_PATH`].
fn collision_order(pairs: &[Pair]) -> String {
    let solids = pairs[0].giver_solids.iter().count();
    let settles: Vec<Vec<bool>> = (0..solids)
        .into_par_iter()
        .map(|solid| {
            let settles = |pair: &Pair| {
                let theirs = pair.giver_solids.iter().nth(solid);
                let nears = |ours: &TaperedCapsule| {
                    theirs.is_some_and(|theirs| ours.distance(theirs) < GIVER_CLEARANCE)
                };
                pair.grip.iter().any(nears)
            };
            pairs.iter().map(settles).collect()
        })
        .collect();
    let (order, settled) = cover(solids, &settles);
    let found = |count: usize| 100.0 * settled[count - 1];
    let mut text = String::from(
        "//! Which of a giver's solids detect most collisions: written by `grasp-assets-generator screens`, not by hand.\n\n\
         use crate::physical::solids::TrackedSolids;\n",
    );
    let _ = write!(
        text,
        "\n/// Indices of [`TrackedSolids::iter`]. The first four find {:.0} % of the collisions of known grips and givers, the first\n\
         /// eight {:.0} %.\n\
         #[rustfmt::skip]\n\
         pub(super) const COLLISION_ORDER: [usize; TrackedSolids::COUNT] = [\n",
        found(4),
        found(8)
    );
    for row in order.chunks(20) {
        let row: Vec<String> = row.iter().map(usize::to_string).collect();
        let _ = writeln!(text, "    {},", row.join(", "));
    }
    text + "];\n"
}
