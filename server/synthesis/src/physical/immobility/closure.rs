//! Closure: how large a disturbance the contacts can resist.

use super::{
    Buffers, Load, SoftContact,
    contact_model::{ContactCone, ScaledWrench, dot, farthest_wrench},
    polytope::Polytope,
};

/// How much of the true epsilon [`epsilon`] may leave out, as a share of it. A smaller one costs time: the polytope grows
/// until it is that near.
pub const EPSILON_TOLERANCE: f32 = 0.05;

/// Steps of Gilbert's algorithm that look for a disturbance nobody resists before a polytope is built. More find more
/// of those, but cost every grasp that has closure.
const GILBERT_STEPS: usize = 12;

/// When so many facets have been made, some 1 ms of work, the bound is taken as it is. Grasps need about 1,000; more
/// would only bring epsilon nearer for those that hold equally badly in very many directions.
const MAX_FACETS_MADE: usize = 10_000;

/// Contacts that resist less than this in some direction have no closure: below, single precision decides.
const NO_CLOSURE: f64 = 1e-6;

/// Ferrari and Canny's epsilon (1992) of soft-finger contacts: the radius of the largest ball about the origin inside the
/// convex hull of the unit wrenches of all contacts. That is the L1 convention: the normal forces sum to one newton. The
/// number is the longest disturbance, as a share of the summed normal forces, that the contacts resist from wherever it
/// comes; torque is over the characteristic length, and the number without unit. 0 if there is no closure.
///
/// The value is a lower bound, at most [`EPSILON_TOLERANCE`] below the true one unless that took more than about 1 ms. If it cannot reach `required`, the search
/// ends as soon as that is certain, and the value is only some number below `required`; with `required` 0, it is always
/// followed to its end.
pub fn epsilon(contacts: &[SoftContact], load: &Load, required: f32, buffers: &mut Buffers) -> f32 {
    let resisted = least_resisted(model(contacts, load, &mut buffers.cones));
    let required = f64::from(required);
    if resisted <= NO_CLOSURE {
        return 0.0;
    }
    if resisted < required {
        return resisted as f32;
    }
    inscribed_sphere(&buffers.cones, resisted, required, &mut buffers.polytope) as f32
}

/// At most how much [`epsilon`] is, found in a tenth of the time; 0 if there surely is no closure.
pub fn epsilon_upper_bound(contacts: &[SoftContact], load: &Load, buffers: &mut Buffers) -> f32 {
    least_resisted(model(contacts, load, &mut buffers.cones)) as f32
}

/// The contacts as cones.
fn model<'a>(contacts: &[SoftContact], load: &Load, cones: &'a mut Vec<ContactCone>) -> &'a [ContactCone] {
    cones.clear();
    cones.extend(contacts.iter().map(|contact| ContactCone::new(contact, load)));
    cones
}

/// An upper bound of epsilon, 0 if there surely is no closure: Gilbert's algorithm (1966) walks to the point of the
/// hull that is nearest to the origin. While the origin is outside or near the surface, the directions on its way are
/// those that the contacts resist least.
fn least_resisted(cones: &[ContactCone]) -> f64 {
    let mut point: ScaledWrench = [0.0; 6];
    for cone in cones {
        for (sum, part) in point.iter_mut().zip(cone.wrench(&cone.normal_push())) {
            *sum += part / cones.len() as f64;
        }
    }
    let mut upper = if cones.is_empty() { 0.0 } else { f64::INFINITY };
    for _ in 0..GILBERT_STEPS {
        let length = dot(&point, &point).sqrt();
        if length < 1e-9 {
            break;
        }
        let direction = point.map(|x| -x / length);
        let (reach, wrench) = farthest_wrench(cones, &direction);
        upper = upper.min(reach);
        if upper <= NO_CLOSURE {
            return 0.0;
        }
        // The nearest point to the origin on the segment to the new wrench.
        let step: ScaledWrench = std::array::from_fn(|k| wrench[k] - point[k]);
        let share = (-dot(&point, &step) / dot(&step, &step)).clamp(0.0, 1.0);
        for (x, s) in point.iter_mut().zip(step) {
            *x += share * s;
        }
    }
    upper
}

/// Epsilon from below. The polytope's facet nearest to the origin bounds it from below, what the contacts resist along
/// that facet's normal from above; the wrench that does so becomes a new vertex, until the bounds meet.
fn inscribed_sphere(cones: &[ContactCone], upper: f64, required: f64, polytope: &mut Polytope) -> f64 {
    if !polytope.start(|direction| farthest_wrench(cones, direction)) {
        return 0.0;
    }
    let mut upper = upper;
    loop {
        let facet = polytope.nearest_facet();
        let (normal, lower) = polytope.plane(facet);
        let (reach, wrench) = farthest_wrench(cones, &normal);
        upper = upper.min(reach);
        if upper <= NO_CLOSURE {
            return 0.0;
        }
        if upper < required {
            return upper;
        }
        let near = lower >= (1.0 - f64::from(EPSILON_TOLERANCE)) * upper;
        if near || polytope.facets_made() > MAX_FACETS_MADE || !polytope.expand(facet, wrench) {
            // Rounding must not lift the bound above what is certain.
            return lower.clamp(0.0, upper);
        }
    }
}
