//! The choice of views: directions from which the important parts are most visible.

use glam::{Quat, Vec3};
use rayon::prelude::*;

use crate::{
    camera::Camera,
    raster::{self, NOTHING},
    scene::{Finish, Part, Scene},
    surface::{Triangle, flat_triangles_of, project},
};

/// Candidate directions: their number around the vertical …
const AZIMUTHS: u32 = 12;

/// … at each of these elevations in radians, with a weight: people look slightly down at hands.
const ELEVATIONS: [(f32, f32); 3] = [(-0.15, 0.88), (0.35, 1.0), (0.85, 0.93)];

/// Pixels per row of the trial pictures of candidates.
const TRIAL_WIDTH: usize = 160;

/// Smallest angle between the two views, in radians (70°).
pub const MIN_ANGLE_BETWEEN_VIEWS: f32 = 1.222;

/// Two cameras that frame all parts of some importance in all scenes: the best direction, and the best one at least
/// [`MIN_ANGLE_BETWEEN_VIEWS`] away from it. `importance` weights parts; a part counts by its visible area relative to
/// the largest that any candidate shows in its scene.
pub fn choose_views(
    scenes: &[Scene],
    importance: impl Fn(&Part) -> f32,
    up: Vec3,
    aspect: f32,
) -> [Camera; 2] {
    let parts: Vec<(&Part, f32)> = scenes
        .iter()
        .flat_map(|scene| &scene.parts)
        .map(|part| (part, importance(part)))
        .collect();
    let framed = || {
        let important = parts.iter().filter(|(_, importance)| *importance > 0.0);
        important.flat_map(|(part, _)| part.positions.iter().copied())
    };
    let frame = |direction: Vec3| Camera::framing_points(framed(), direction, up, aspect);
    let corners = framed()
        .map(|p| (p, p))
        .reduce(|(low, high), (p, _)| (low.min(p), high.max(p)));
    let centre = corners.map_or(Vec3::ZERO, |(low, high)| (low + high) * 0.5);
    let to_up = Quat::from_rotation_arc(Vec3::Y, up.normalize_or(Vec3::Y));
    let mut directions = Vec::new();
    for (elevation, welcome) in ELEVATIONS {
        for step in 0..AZIMUTHS {
            let azimuth = Quat::from_rotation_y(step as f32 / AZIMUTHS as f32 * std::f32::consts::TAU);
            let direction = azimuth * Vec3::new(0.0, elevation.sin(), elevation.cos());
            directions.push((to_up * direction, welcome));
        }
    }

    // Candidates fill their pictures: pixels are converted to area in the scene. Otherwise the short end of a long object,
    // seen from close up, would count as much as its side.
    let triangles: Vec<Vec<Triangle>> = scenes.iter().map(flat_triangles_of).collect();
    let areas: Vec<Vec<f32>> = directions
        .par_iter()
        .map(|&(direction, _)| {
            let camera = frame(direction);
            let metres_per_view = camera.world_from_camera.position.distance(centre);
            let of_scenes = scenes.iter().zip(&triangles);
            let mut areas: Vec<f32> = of_scenes
                .flat_map(|(scene, triangles)| visible_areas(triangles, scene.parts.len(), &camera))
                .collect();
            for area in &mut areas {
                *area *= metres_per_view * metres_per_view;
            }
            areas
        })
        .collect();
    let largest: Vec<f32> = (0..parts.len())
        .map(|part| areas.iter().map(|a| a[part]).fold(0.0, f32::max))
        .collect();
    let score = |candidate: usize| {
        let shown = |part: usize| {
            if largest[part] > 0.0 {
                // The root favours showing a little of every part over all of one.
                parts[part].1 * (areas[candidate][part] / largest[part]).sqrt()
            } else {
                0.0
            }
        };
        directions[candidate].1 * (0..parts.len()).map(shown).sum::<f32>()
    };
    let best_of = |candidates: &mut dyn Iterator<Item = usize>| {
        // Ties go to the first.
        candidates.fold(None, |best: Option<(usize, f32)>, candidate| {
            let value = score(candidate);
            match best {
                Some((_, highest)) if highest >= value => best,
                _ => Some((candidate, value)),
            }
        })
    };
    let first = best_of(&mut (0..directions.len())).map_or(0, |(candidate, _)| candidate);
    let far_enough = |&candidate: &usize| {
        directions[candidate].0.angle_between(directions[first].0) >= MIN_ANGLE_BETWEEN_VIEWS
    };
    let second =
        best_of(&mut (0..directions.len()).filter(far_enough)).map_or(first, |(candidate, _)| candidate);
    [first, second].map(|candidate| frame(directions[candidate].0))
}

/// The visible pixels of each part in a trial picture. Markers hide nothing.
fn visible_areas(triangles: &[Triangle], parts: usize, camera: &Camera) -> Vec<f32> {
    let height = ((TRIAL_WIDTH as f32 / camera.aspect) as usize).max(1);
    let draw = |markers: bool| {
        let wanted = |t: &Triangle| (t.finish == Finish::Marker) == markers;
        let screen = project(triangles, camera, TRIAL_WIDTH, height, wanted);
        raster::rasterise(TRIAL_WIDTH, height, &screen, |_, _, _| true)
    };
    let (solid, markers) = (draw(false), draw(true));
    let mut areas = vec![0.0; parts];
    for pixel in 0..TRIAL_WIDTH * height {
        if solid.ids[pixel] != NOTHING {
            areas[triangles[solid.ids[pixel] as usize].part as usize] += 1.0;
        }
        if markers.ids[pixel] != NOTHING && markers.depths[pixel] >= solid.depths[pixel] {
            areas[triangles[markers.ids[pixel] as usize].part as usize] += 1.0;
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::primitives::{capsule, sphere};

    #[test]
    fn shows_long_objects_from_the_side() {
        let rod = capsule(
            "rod",
            Vec3::new(-0.2, 0.0, 0.0),
            Vec3::new(0.2, 0.0, 0.0),
            0.02,
            [1.0; 4],
        );
        let scene = Scene { parts: vec![rod] };
        for camera in choose_views(&[scene], |_| 1.0, Vec3::Y, 1.3) {
            let along = camera.world_from_camera.transform_vector(Vec3::Z).x.abs();
            assert!(along < 0.75, "looks along the rod: {along}");
        }
    }

    #[test]
    fn first_view_avoids_occluding_wall() {
        let wall = Part::new(
            "wall",
            vec![
                Vec3::new(-1.0, -1.0, 0.0),
                Vec3::new(1.0, -1.0, 0.0),
                Vec3::new(1.0, 1.0, 0.0),
                Vec3::new(-1.0, 1.0, 0.0),
            ],
            vec![[0, 1, 2], [0, 2, 3]],
            [1.0; 4],
        );
        for side in [-1.0, 1.0] {
            let ball = sphere("ball", Vec3::new(0.0, 0.0, 0.3 * side), 0.1, [1.0; 4]);
            let mark =
                sphere("mark", Vec3::new(0.0, 0.0, 0.45 * side), 0.03, [1.0; 4]).with_finish(Finish::Marker);
            let scene = Scene {
                parts: vec![wall.clone(), ball, mark],
            };
            let importance = |part: &Part| if part.name == "wall" { 0.0 } else { 1.0 };
            let [first, second] = choose_views(&[scene], importance, Vec3::Y, 1.3);
            let towards = |camera: &Camera| camera.world_from_camera.transform_vector(Vec3::Z);
            assert!(towards(&first).z * side > 0.3, "looks from {}", towards(&first));
            assert!(towards(&first).angle_between(towards(&second)) >= MIN_ANGLE_BETWEEN_VIEWS - 1e-3);
        }
    }
}
