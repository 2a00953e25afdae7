//! The choice of a view: the direction from which the important parts are most visible.

use glam::{Quat, Vec2, Vec3};
use rayon::prelude::*;

use crate::{
    camera::Camera,
    scene::{Finish, Part, Scene},
    tracer::Tracer,
};

/// Candidate directions: their number around the vertical …
const AZIMUTHS: u32 = 12;

/// … at each of these elevations in radians, with a weight: people look slightly down at hands.
const ELEVATIONS: [(f32, f32); 3] = [(-0.15, 0.88), (0.35, 1.0), (0.85, 0.93)];

/// Pixels per row of the trial pictures of candidates.
const TRIAL_WIDTH: usize = 112;

/// The best camera that frames all parts that are to be seen. `importance` weights parts, and is negative for those that are better
/// not seen; a part counts by its visible area relative to the largest that any candidate shows.
pub(crate) fn best_view(scene: &Scene, importance: impl Fn(&Part) -> f32, up: Vec3, aspect: f32) -> Camera {
    let weights: Vec<f32> = scene.parts.iter().map(importance).collect();
    let framed: Vec<Vec3> = scene
        .parts
        .iter()
        .zip(&weights)
        .filter(|(_, weight)| **weight > 0.0)
        .flat_map(|(part, _)| part.positions.iter().copied())
        .collect();
    let low = framed.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = framed.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    let to_up = Quat::from_rotation_arc(Vec3::Y, up.normalize_or(Vec3::Y));
    let candidates: Vec<(Camera, f32)> = ELEVATIONS
        .iter()
        .flat_map(|&(elevation, welcome)| (0..AZIMUTHS).map(move |step| (elevation, welcome, step)))
        .map(|(elevation, welcome, step)| {
            let azimuth = Quat::from_rotation_y(step as f32 / AZIMUTHS as f32 * std::f32::consts::TAU);
            let direction = to_up * azimuth * Vec3::new(0.0, elevation.sin(), elevation.cos());
            let camera = Camera::framing(framed.iter().copied(), direction, up, aspect);
            (camera, welcome)
        })
        .collect();

    // Candidates fill their pictures: pixels are converted to area in the scene. Otherwise the short end of a long object,
    // seen from close up, would count as much as its side.
    let solids = Tracer::new(scene, |part| part.finish != Finish::Marker);
    let markers = Tracer::new(scene, |part| part.finish == Finish::Marker);
    let areas: Vec<Vec<f32>> = candidates
        .par_iter()
        .map(|(camera, _)| {
            let distance = camera.world_from_camera.position.distance(0.5 * (low + high));
            let mut areas = vec![0.0; scene.parts.len()];
            for part in visible_parts(&solids, &markers, camera, aspect) {
                areas[part] += distance * distance;
            }
            areas
        })
        .collect();
    let largest = |part: usize| {
        areas
            .iter()
            .map(|areas| areas[part])
            .fold(f32::MIN_POSITIVE, f32::max)
    };
    let largest: Vec<f32> = (0..weights.len()).map(largest).collect();
    let score = |candidate: usize| {
        // The root favours showing a little of every part over all of one.
        let shown = |part: usize| weights[part] * (areas[candidate][part] / largest[part]).sqrt();
        candidates[candidate].1 * (0..weights.len()).map(shown).sum::<f32>()
    };
    // Ties go to the first.
    let best = (0..candidates.len())
        .rev()
        .max_by(|&a, &b| score(a).total_cmp(&score(b)));
    candidates[best.unwrap_or_default()].0
}

/// The parts that the pixels of a trial picture show. Markers hide nothing.
fn visible_parts(solids: &Tracer, markers: &Tracer, camera: &Camera, aspect: f32) -> Vec<usize> {
    let eye = camera.world_from_camera.position;
    let height = ((TRIAL_WIDTH as f32 / aspect) as usize).max(1);
    let size = Vec2::new(TRIAL_WIDTH as f32, height as f32);
    let mut parts = Vec::new();
    for pixel in 0..TRIAL_WIDTH * height {
        let at = Vec2::new((pixel % TRIAL_WIDTH) as f32, (pixel / TRIAL_WIDTH) as f32) + 0.5;
        let ray = camera.ray(at / size);
        let solid = solids.first_hit(eye, ray);
        let marker = markers.first_hit(eye, ray);
        let is_hidden = |distance: f32| solid.is_some_and(|solid| solid.distance < distance);
        parts.extend(
            marker
                .filter(|marker| !is_hidden(marker.distance))
                .map(|hit| hit.part),
        );
        parts.extend(solid.map(|hit| hit.part));
    }
    parts
}

#[cfg(test)]
mod tests {
    use grasp_synthesis::geometry::tapered_capsule::TaperedCapsule;

    use super::*;
    use crate::primitives::{capsule, sphere};

    fn towards(camera: &Camera) -> Vec3 {
        camera.world_from_camera.transform_vector(Vec3::Z)
    }

    #[test]
    fn shows_long_objects_from_the_side() {
        let rod = TaperedCapsule::new(Vec3::NEG_X * 0.2, Vec3::X * 0.2, 0.02, 0.02);
        let rod = capsule("rod", &rod, Vec3::ONE);
        let along = towards(&best_view(&Scene { parts: vec![rod] }, |_| 1.0, Vec3::Y, 1.3))
            .x
            .abs();
        assert!(along < 0.75, "looks along the rod: {along}");
    }

    #[test]
    fn avoids_occluding_wall() {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0));
        let wall = Part::new("wall", corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]], Vec3::ONE);
        for side in [-1.0, 1.0] {
            let ball = sphere("ball", Vec3::Z * 0.3 * side, 0.1, Vec3::ONE);
            let mark = sphere("mark", Vec3::Z * 0.45 * side, 0.03, Vec3::ONE).with_finish(Finish::Marker);
            let scene = Scene {
                parts: vec![wall.clone(), ball, mark],
            };
            let importance = |part: &Part| if part.name == "wall" { 0.0 } else { 1.0 };
            let view = towards(&best_view(&scene, importance, Vec3::Y, 1.3));
            assert!(view.z * side > 0.3, "looks from {view}");
        }
    }
}
