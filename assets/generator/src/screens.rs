//! Derives the tables that show soonest that two hands meet: which spheres inside a hand to compare first, and which of a
//! giver's solids.
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
        barriers::Barriers,
        grip::GIVER_CLEARANCE,
        solids::{PreparedHand, SPHERES, TaperedCapsule, TrackedSolids},
    },
};
use rayon::prelude::*;

/// Givers per object.
const GIVERS: usize = 48;

/// Grips per giver.
const GRIPS: usize = 400;

/// Where along a solid's axis spheres may be.
const ALONG: [f32; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];

/// A known grip and a giver that meet.
struct Pair {
    giver: PreparedHand,
    giver_solids: TrackedSolids,
    grip: TrackedSolids,
    /// Does no cell of the atlas show that they meet?
    is_left_by_cells: bool,
    /// Do the spheres that are in use show it?
    is_settled: bool,
}

/// Prints the tables as Rust, and how much they settle next to those in use.
pub(crate) fn print() {
    let rig = &hand("adult", Handedness::Right).expect("the rig is built in").rig;
    let pairs: Vec<Pair> = objects()
        .iter()
        .flat_map(|object| {
            let known = complete_atlas(object.name, rig);
            pairs(&known, rig)
        })
        .collect();
    println!("{} pairs that meet", pairs.len());
    print_spheres(&pairs);
    print_giver_order(&pairs);
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
            let excluded = known.excluded_by(&giver);
            let pair = |grip: usize| {
                let index = grip * count / GRIPS;
                let solids = known.entries()[index].tracked_solids(rig);
                let meets = giver.clearance(&solids, GIVER_CLEARANCE).is_none();
                meets.then(|| Pair {
                    giver: giver.clone(),
                    giver_solids,
                    grip: solids,
                    is_left_by_cells: !excluded.contains(index as u16),
                    is_settled: known
                        .grips()
                        .screen(index, rig, Barriers::of_giver(&giver))
                        .is_none(),
                })
            };
            (0..GRIPS).filter_map(pair).collect::<Vec<_>>()
        })
        .collect()
}

/// Members in the order of a greedy cover: `settles` says of a member which pairs it settles.
fn cover(members: usize, length: usize, settles: &[Vec<bool>]) -> (Vec<usize>, Vec<f64>) {
    let pairs = settles[0].len();
    let mut is_open = vec![true; pairs];
    let (mut order, mut settled) = (Vec::new(), Vec::new());
    while order.len() < length {
        let gain = |member: &usize| {
            let both = settles[*member].iter().zip(&is_open);
            both.filter(|(settles, open)| **settles && **open).count()
        };
        // Of members that settle as many, the first.
        let left = (0..members).rev().filter(|member| !order.contains(member));
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

fn print_spheres(pairs: &[Pair]) {
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
    let (order, settled) = cover(spheres.len(), 2 * SPHERES, &settles);
    for (name, table) in ["FIRST", "SECOND"].into_iter().zip(order.chunks(SPHERES)) {
        let mut text = format!("const {name}: [Core; SPHERES] = [\n");
        for &sphere in table {
            let (solid, along) = spheres[sphere];
            let _ = writeln!(text, "    ({solid}, {along:?}),");
        }
        println!("{text}];");
    }
    let in_use = pairs.iter().filter(|pair| pair.is_settled).count();
    println!(
        "the first {SPHERES} settle {:.2} %, all {:.2} %; those in use {:.2} %\n",
        100.0 * settled[SPHERES - 1],
        100.0 * settled[2 * SPHERES - 1],
        100.0 * in_use as f64 / pairs.len() as f64
    );
}

fn print_giver_order(pairs: &[Pair]) {
    let pairs: Vec<&Pair> = pairs.iter().filter(|pair| pair.is_left_by_cells).collect();
    let solids = pairs[0].giver_solids.iter().count();
    let settles: Vec<Vec<bool>> = (0..solids)
        .into_par_iter()
        .map(|solid| {
            let settles = |pair: &&Pair| {
                let theirs = pair.giver_solids.iter().nth(solid);
                let nears = |ours: &TaperedCapsule| {
                    theirs.is_some_and(|theirs| ours.distance(theirs) < GIVER_CLEARANCE)
                };
                pair.grip.iter().any(nears)
            };
            pairs.iter().map(settles).collect()
        })
        .collect();
    let (order, settled) = cover(solids, solids, &settles);
    println!("const MET_FIRST: [usize; TrackedSolids::COUNT] = {order:?};");
    // Which of the solids come first in a hand that is prepared as it is in use.
    let in_use: Vec<usize> = pairs[0]
        .giver
        .iter()
        .filter_map(|solid| pairs[0].giver_solids.iter().position(|other| other == solid))
        .collect();
    let settled_in_use = |count: usize| {
        let first = &in_use[..count];
        let is_settled = |pair: &usize| first.iter().any(|&solid| settles[solid][*pair]);
        (0..pairs.len()).filter(is_settled).count() as f64 / pairs.len() as f64
    };
    for count in [4, 8] {
        println!(
            "the first {count} settle {:.2} %; those in use {:.2} %",
            100.0 * settled[count - 1],
            100.0 * settled_in_use(count)
        );
    }
}
