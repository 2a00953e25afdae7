//! Which closed parts of a mesh lie inside others, and which are inside out.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::winding::corners;

/// Work per triangle of the mesh that may be spent on comparing parts: triangles seen from a point, and boxes compared.
const WORK_PER_TRIANGLE: usize = 64;

/// Work that may be spent in any case.
const MIN_WORK: usize = 1 << 16;

/// Share of a box's volume below which an enclosed volume counts as rounding error.
const NO_VOLUME: f64 = 1e-9;

/// A closed part of a mesh.
#[derive(Debug)]
pub(crate) struct Closed {
    triangles: Vec<u32>,
    low: Vec3,
    high: Vec3,
    /// Enclosed volume; negative if the part is inside out, 0 if there is none.
    volume: f64,
}

impl Closed {
    pub(crate) fn new(members: Vec<u32>, positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for corner in members.iter().flat_map(|&member| triangles[member as usize]) {
            low = low.min(positions[corner as usize]);
            high = high.max(positions[corner as usize]);
        }
        let middle = low.as_dvec3().midpoint(high.as_dvec3());
        let tetrahedra = members.iter().map(|&member| {
            let [a, b, c] = corners(positions, triangles[member as usize]).map(|corner| corner - middle);
            a.dot(b.cross(c)) / 6.0
        });
        let volume: f64 = tetrahedra.sum();
        let of_box = (high.as_dvec3() - low.as_dvec3()).element_product();
        Self {
            triangles: members,
            low,
            high,
            volume: if volume.abs() > NO_VOLUME * of_box {
                volume
            } else {
                0.0
            },
        }
    }

    fn is_in_box_of(&self, other: &Self) -> bool {
        self.low.cmpge(other.low).all() && self.high.cmple(other.high).all()
    }

    /// Whether the part encloses a point: how often, by the solid angles of its triangles.
    fn encloses(&self, point: DVec3, positions: &[Vec3], triangles: &[[u32; 3]]) -> bool {
        let shares = self.triangles.iter().map(|&member| {
            let [a, b, c] = corners(positions, triangles[member as usize]).map(|corner| corner - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            a.dot(b.cross(c)).atan2(below) / TAU
        });
        shares.sum::<f64>().abs() > 0.5
    }
}

/// The parts to turn, by index: those that are inside out and not enclosed, and all that these enclose.
///
/// A part that faces inward inside another is the wall of a cavity. If there are too many parts to compare, all are turned if
/// their volumes together are negative, and none otherwise.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn facing_inward(
    parts: &[Closed],
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    stop: Stop<'_>,
) -> Result<Vec<usize>, Stopped> {
    if parts.iter().all(|part| part.volume >= 0.0) {
        return Ok(Vec::new());
    }
    let mut by_volume: Vec<usize> = (0..parts.len())
        .filter(|&part| parts[part].volume != 0.0)
        .collect();
    by_volume.sort_by(|&a, &b| parts[b].volume.abs().total_cmp(&parts[a].volume.abs()));
    let mut work = MIN_WORK + WORK_PER_TRIANGLE * triangles.len();
    let mut outermost: Vec<usize> = Vec::new();
    let mut inward = Vec::new();
    let mut is_inward = vec![false; parts.len()];
    for index in by_volume.iter().copied() {
        stop.check()?;
        let part = &parts[index];
        let Some(point) = part.triangles.first().map(|&first| {
            let [a, _, _] = corners(positions, triangles[first as usize]);
            a
        }) else {
            continue;
        };
        let mut around = None;
        for &other in &outermost {
            let candidate = &parts[other];
            let is_near = part.is_in_box_of(candidate);
            let cost = if is_near { candidate.triangles.len() } else { 1 };
            let Some(left) = work.checked_sub(cost) else {
                let sum: f64 = parts.iter().map(|part| part.volume).sum();
                return Ok(if sum < 0.0 { by_volume } else { Vec::new() });
            };
            work = left;
            if is_near && candidate.encloses(point, positions, triangles) {
                around = Some(other);
                break;
            }
        }
        is_inward[index] = around.map_or(part.volume < 0.0, |other| is_inward[other]);
        if around.is_none() {
            outermost.push(index);
        }
        if is_inward[index] {
            inward.push(index);
        }
    }
    Ok(inward)
}
