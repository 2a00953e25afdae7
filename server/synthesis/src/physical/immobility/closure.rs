//! Closure: the largest disturbance that the contacts resist in every direction.

use super::{
    Buffers, Load, SoftContact,
    contact_model::{ContactCone, ScaledWrench, dot, farthest_wrench},
    polytope::Polytope,
};

/// Relative error of [`epsilon`], which is a lower bound. Smaller values take longer: the polytope grows until it is
/// that close.
pub const EPSILON_TOLERANCE: f32 = 0.05;

/// Steps of Gilbert's algorithm that look for an unresisted disturbance before a polytope is built. More steps reject
/// more grasps early but slow down every grasp with closure.
const GILBERT_STEPS: usize = 12;

/// Limit on the facets built, some 1 ms of work; the bound reached by then is returned. Grasps need about 1,000; only
/// grasps equally weak in very many directions need more.
const MAX_FACETS_MADE: usize = 10_000;

/// Contacts that resist less than this in some direction have no closure: below it, single precision decides.
const NO_CLOSURE: f64 = 1e-6;

/// Ferrari and Canny's epsilon (1992) of soft-finger contacts: the radius of the largest ball about the origin inside
/// the convex hull of the unit wrenches of all contacts. This is the L1 convention, in which the normal forces sum to
/// one newton: epsilon is the largest disturbance, as a share of the summed normal forces, that the contacts resist
/// in every direction. Torque is divided by the length of the torque scale, so epsilon has no unit. 0 means no closure.
///
/// The value is a lower bound, within [`EPSILON_TOLERANCE`] of the true one unless that takes more than about 1 ms.
/// With `required` above 0, the search ends as soon as epsilon cannot reach it, and the value is merely some number
/// below `required`.
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

/// An upper bound of [`epsilon`], in a tenth of the time; 0 if there is certainly no closure.
pub fn epsilon_upper_bound(contacts: &[SoftContact], load: &Load, buffers: &mut Buffers) -> f32 {
    least_resisted(model(contacts, load, &mut buffers.cones)) as f32
}

/// The contacts as cones.
fn model<'a>(contacts: &[SoftContact], load: &Load, cones: &'a mut Vec<ContactCone>) -> &'a [ContactCone] {
    cones.clear();
    cones.extend(contacts.iter().map(|contact| ContactCone::new(contact, load)));
    cones
}

/// An upper bound of epsilon, 0 if there is certainly no closure. Gilbert's algorithm (1966) walks to the point of
/// the hull nearest to the origin; while the origin is outside or near the surface, its directions are those that the
/// contacts resist least.
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
        // The point nearest to the origin on the segment to the new wrench.
        let step: ScaledWrench = std::array::from_fn(|k| wrench[k] - point[k]);
        let share = (-dot(&point, &step) / dot(&step, &step)).clamp(0.0, 1.0);
        for (x, s) in point.iter_mut().zip(step) {
            *x += share * s;
        }
    }
    upper
}

/// Epsilon from below. The polytope's facet nearest to the origin gives a lower bound, the reach of the contacts
/// along its normal an upper one; the wrench with that reach becomes a new vertex, until the bounds meet.
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
            // Rounding must not lift the result above the upper bound.
            return lower.clamp(0.0, upper);
        }
    }
}
