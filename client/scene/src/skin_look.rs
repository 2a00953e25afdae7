//! Details of hands: a paler palm, flushed tips and knuckles, fingernails.

use glam::{Vec2, Vec3};
use grasp_synthesis::model::hand::{
    joints::{JOINT_COUNT, index},
    skin::Skin,
};

use crate::{
    normals::corner_normals,
    scene::{Finish, Part, linear_from_srgb},
    shading::smoothstep,
    surface::curved_point,
};

/// The colours of a person's hands, sRGB.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Complexion {
    /// The back of the hand.
    back: [u8; 3],
    /// The palm and the pads.
    palm: [u8; 3],
    /// Knuckles and fingertips.
    flush: [u8; 3],
    nail: [u8; 3],
}

impl Complexion {
    pub(crate) const FAIR: Self = Self {
        back: [224, 178, 152],
        palm: [230, 180, 158],
        flush: [214, 146, 124],
        nail: [236, 196, 184],
    };
    pub(crate) const BROWN: Self = Self {
        back: [138, 92, 68],
        palm: [186, 136, 108],
        flush: [122, 74, 54],
        nail: [184, 138, 118],
    };
}

/// Rows and columns of a fingernail's grid.
const NAIL_ROWS: usize = 10;
const NAIL_COLUMNS: usize = 9;

/// Half a nail's length and width, in units of the fingertip's radius.
const NAIL_HALF_LENGTH: f32 = 0.78;
const NAIL_HALF_WIDTH: f32 = 0.72;

/// Distance from the skin's end to the nail's free edge, in units of the fingertip's radius.
const NAIL_SETBACK: f32 = 0.22;

/// Roundness of a nail's corners: 0 for a rectangle, 1 for an ellipse.
const NAIL_ROUNDNESS: f32 = 0.75;

/// Height of a nail's middle over the skin, in metres; its rim is sunk as deep.
const NAIL_LIFT: f32 = 0.35e-3;

/// The skin and the nails of a posed hand, named `{who}_hand` and `{who}_nails`.
pub(crate) fn hand_parts(who: &str, skin: &Skin, posed: Vec<Vec3>, complexion: Complexion) -> Vec<Part> {
    let bind = smooth_part(String::new(), skin.positions.clone(), skin.triangles.clone());
    let bind_normals = vertex_normals(&bind);
    let mut hand = smooth_part(format!("{who}_hand"), posed, skin.triangles.clone());
    hand.colour = rgba(complexion.back);
    hand.vertex_colours = (0..skin.positions.len())
        .map(|vertex| colour_at(skin, vertex, bind_normals[vertex], complexion))
        .collect();
    let nails = nails(who, skin, &hand, complexion);
    let mut parts = vec![hand];
    parts.extend(nails);
    parts
}

/// The joints that move each vertex of a part, as `OpenXR` indices, and their weights, as in [`Skin`].
pub(crate) struct Binding {
    pub(crate) joints: Vec<[u8; 4]>,
    pub(crate) weights: Vec<[f32; 4]>,
}

/// The same parts in the skin's bind pose, with what moves them.
pub(crate) fn bound_hand_parts(who: &str, skin: &Skin, complexion: Complexion) -> Vec<(Part, Binding)> {
    let parts = hand_parts(who, skin, skin.positions.clone(), complexion);
    let of_nails = index::TIP_OF_DIGIT
        .into_iter()
        .filter_map(|tip| nail_places(skin, tip));
    let (joints, weights) = of_nails.flatten().map(|place| weights_at(skin, place)).unzip();
    let bindings = [
        Binding {
            joints: skin.joint_indices.clone(),
            weights: skin.weights.clone(),
        },
        Binding { joints, weights },
    ];
    parts.into_iter().zip(bindings).collect()
}

/// The four joints that move a point of the skin most, and their weights.
fn weights_at(skin: &Skin, place: Place) -> ([u8; 4], [f32; 4]) {
    let mut all = [0.0; JOINT_COUNT];
    for (vertex, share) in skin.triangles[place.triangle].into_iter().zip(place.shares()) {
        let vertex = vertex as usize;
        for (&joint, &weight) in skin.joint_indices[vertex].iter().zip(&skin.weights[vertex]) {
            all[usize::from(joint)] += share * weight;
        }
    }
    let mut order: [u8; JOINT_COUNT] = std::array::from_fn(|joint| joint as u8);
    order.sort_by(|&a, &b| all[usize::from(b)].total_cmp(&all[usize::from(a)]));
    let joints = [order[0], order[1], order[2], order[3]];
    let weights = joints.map(|joint| all[usize::from(joint)]);
    let sum: f32 = weights.iter().sum();
    (joints, weights.map(|weight| weight / sum))
}

fn smooth_part(name: String, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Part {
    Part {
        crease_angle: std::f32::consts::PI,
        finish: Finish::Skin,
        ..Part::new(name, positions, triangles, [1.0; 4])
    }
}

fn vertex_normals(part: &Part) -> Vec<Vec3> {
    let mut normals = vec![Vec3::Y; part.positions.len()];
    for (triangle, corners) in part.triangles.iter().zip(corner_normals(part)) {
        for (&vertex, normal) in triangle.iter().zip(corners) {
            normals[vertex as usize] = normal;
        }
    }
    normals
}

/// The skin's colour at a vertex of the bind pose.
fn colour_at(skin: &Skin, vertex: usize, normal: Vec3, complexion: Complexion) -> Vec3 {
    let [back, palm, flush] = [complexion.back, complexion.palm, complexion.flush].map(rgb);
    let mut palmar = 0.0;
    let mut flushed = 0.0_f32;
    for (&joint, &weight) in skin.joint_indices[vertex].iter().zip(&skin.weights[vertex]) {
        let pose = skin.bind.joints[usize::from(joint)].pose;
        // +Y points out of the back of the hand.
        palmar -= weight * normal.dot(pose.transform_vector(Vec3::Y));
    }
    for digit in 0..5 {
        let tip = index::TIP_OF_DIGIT[digit];
        // The joints that bend: from the base of the first phalanx to that of the last.
        let first = index::FIRST_OF_DIGIT[digit] + 1;
        for joint in first..=tip {
            let joint_at = skin.bind.joints[joint];
            let near = 1.0
                - smoothstep(
                    0.5,
                    1.45,
                    skin.positions[vertex].distance(joint_at.pose.position) / joint_at.radius.max(1e-3),
                );
            let share = if joint == tip {
                0.45
            } else {
                0.55 * smoothstep(0.1, 0.8, -palmar)
            };
            flushed = flushed.max(near * share);
        }
    }
    back.lerp(palm, smoothstep(-0.15, 0.55, palmar))
        .lerp(flush, flushed)
}

/// Fingernails: small patches on the back of each fingertip that follow the skin.
fn nails(who: &str, skin: &Skin, hand: &Part, complexion: Complexion) -> Option<Part> {
    let posed_normals = vertex_normals(hand);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for tip in index::TIP_OF_DIGIT {
        let Some(places) = nail_places(skin, tip) else {
            continue;
        };
        let first = positions.len() as u32;
        for (i, place) in places.iter().enumerate() {
            let corners = hand.triangles[place.triangle].map(|v| v as usize);
            let shares = Vec3::from(place.shares());
            let normals = corners.map(|v| posed_normals[v]);
            let on_skin = curved_point(corners.map(|v| hand.positions[v]), normals, shares);
            let normal = normals[0] * shares.x + normals[1] * shares.y + normals[2] * shares.z;
            let (row, column) = (i / NAIL_COLUMNS, i % NAIL_COLUMNS);
            let rim = row == 0 || row + 1 == NAIL_ROWS || column == 0 || column + 1 == NAIL_COLUMNS;
            let lift = if rim { -NAIL_LIFT } else { NAIL_LIFT };
            positions.push(on_skin + normal.normalize_or_zero() * lift);
        }
        for row in 1..NAIL_ROWS {
            for column in 1..NAIL_COLUMNS {
                let corner = first + (row * NAIL_COLUMNS + column) as u32;
                let (left, above) = (corner - 1, corner - NAIL_COLUMNS as u32);
                triangles.push([above - 1, above, corner]);
                triangles.push([above - 1, corner, left]);
            }
        }
    }
    if triangles.is_empty() {
        return None;
    }
    Some(Part {
        crease_angle: std::f32::consts::PI,
        ..Part::new(
            format!("{who}_nails"),
            positions,
            triangles,
            rgba(complexion.nail),
        )
    })
}

/// A point on the skin: a triangle and the barycentric coordinates of its second and third corner.
#[derive(Clone, Copy)]
struct Place {
    triangle: usize,
    share: Vec2,
}

impl Place {
    /// The barycentric coordinates of all three corners.
    fn shares(self) -> [f32; 3] {
        [1.0 - self.share.x - self.share.y, self.share.x, self.share.y]
    }
}

/// The points of a nail's grid in the bind pose, row by row from the root; none if there is no skin.
fn nail_places(skin: &Skin, tip: usize) -> Option<Vec<Place>> {
    let distal = skin.bind.joints[tip - 1].pose;
    let radius = skin.bind.joints[tip].radius;
    let tip_at = distal
        .inverse()
        .transform_point(skin.bind.joints[tip].pose.position);
    let is_of_tip = |vertex: u32| {
        let vertex = vertex as usize;
        let weights = skin.joint_indices[vertex].iter().zip(&skin.weights[vertex]);
        let share: f32 = weights
            .filter(|(joint, _)| usize::from(**joint) == tip || usize::from(**joint) == tip - 1)
            .map(|(_, weight)| weight)
            .sum();
        share > 0.5
    };
    let near: Vec<(usize, [Vec3; 3])> = skin
        .triangles
        .iter()
        .enumerate()
        .filter(|(_, triangle)| triangle.iter().all(|&v| is_of_tip(v)))
        .map(|(i, t)| {
            let local = t.map(|v| distal.inverse().transform_point(skin.positions[v as usize]));
            (i, local)
        })
        .collect();
    // The distal frame's -z points to the tip.
    let skin_end = near
        .iter()
        .flat_map(|(_, corners)| corners)
        .map(|corner| corner.z)
        .fold(f32::INFINITY, f32::min);
    let centre = Vec2::new(tip_at.x, skin_end + radius * (NAIL_SETBACK + NAIL_HALF_LENGTH));
    let from_minus_to_plus = |i: usize, count: usize| i as f32 / (count - 1) as f32 * 2.0 - 1.0;
    let mut places = Vec::with_capacity(NAIL_ROWS * NAIL_COLUMNS);
    for row in 0..NAIL_ROWS {
        for column in 0..NAIL_COLUMNS {
            let (u, v) = (
                from_minus_to_plus(column, NAIL_COLUMNS),
                from_minus_to_plus(row, NAIL_ROWS),
            );
            // The square, blended toward an ellipse.
            let across = u * (1.0 - NAIL_ROUNDNESS * v * v * 0.5).sqrt();
            let along = v * (1.0 - NAIL_ROUNDNESS * u * u * 0.5).sqrt();
            let at = centre + radius * Vec2::new(NAIL_HALF_WIDTH * across, -NAIL_HALF_LENGTH * along);
            places.push(highest_hit(&near, at)?);
        }
    }
    Some(places)
}

/// The highest (+y) of the triangles above a point of the x-z plane.
fn highest_hit(triangles: &[(usize, [Vec3; 3])], at: Vec2) -> Option<Place> {
    let mut highest = f32::NEG_INFINITY;
    let mut place = None;
    for &(triangle, corners) in triangles {
        let [a, b, c] = corners.map(|p| Vec2::new(p.x, p.z));
        let area = (b - a).perp_dot(c - a);
        if area.abs() < 1e-14 {
            continue;
        }
        let v = (at - a).perp_dot(c - a) / area;
        let w = (b - a).perp_dot(at - a) / area;
        if v < 0.0 || w < 0.0 || v + w > 1.0 {
            continue;
        }
        let y = corners[0].y * (1.0 - v - w) + corners[1].y * v + corners[2].y * w;
        if y > highest {
            highest = y;
            place = Some(Place {
                triangle,
                share: Vec2::new(v, w),
            });
        }
    }
    place
}

fn rgba([r, g, b]: [u8; 3]) -> [f32; 4] {
    linear_from_srgb(r, g, b)
}

fn rgb(colour: [u8; 3]) -> Vec3 {
    let [r, g, b, _] = rgba(colour);
    Vec3::new(r, g, b)
}
