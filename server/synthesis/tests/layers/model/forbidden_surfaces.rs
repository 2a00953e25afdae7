//! Distance queries against an object's forbidden surface.

use crate::prelude::*;

/// Compares with sampled points of the forbidden triangles.
#[test]
fn is_forbidden_within_matches_the_forbidden_triangles() {
    const STEPS: u16 = 12;
    const RADIUS: f32 = 0.002;
    for (name, least_near) in [("remote", 50), ("scalpel", 20), ("scissors", 0)] {
        let object = object(name);
        let mesh = object.surface.mesh();
        let forbidden = (0..mesh.triangles().len()).filter(|&t| object.is_forbidden(t as u32));
        let mut points = Vec::new();
        let mut slack: f32 = 0.0;
        for [a, b, c] in forbidden.map(|triangle| mesh.corners(triangle)) {
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            slack = slack.max(longest / f32::from(STEPS));
            for i in 0..=STEPS {
                for j in 0..=STEPS - i {
                    let [u, v] = [i, j].map(|step| f32::from(step) / f32::from(STEPS));
                    points.push(a + (b - a) * u + (c - a) * v);
                }
            }
        }
        let (mut near, mut far) = (0, 0);
        for triangle in (0..mesh.triangles().len()).step_by(7) {
            for (above, distance) in [(0.003, 0.002), (0.006, 0.006), (0.012, 0.004)] {
                let middle =
                    mesh.corners(triangle).iter().sum::<Vec3>() / 3.0 + mesh.normal(triangle) * above;
                let away = points.iter().map(|point| point.distance(middle));
                let gap = away.fold(f32::INFINITY, f32::min) - RADIUS;
                if (gap - distance).abs() <= slack {
                    continue;
                }
                let ball = TaperedCapsule::new(middle, middle, RADIUS, RADIUS);
                let is_near = object.is_forbidden_within(&ball, distance);
                assert_eq!(is_near, gap < distance, "{name}: {gap} from {middle}");
                *if is_near { &mut near } else { &mut far } += 1;
            }
        }
        assert!(near >= least_near && far >= 20, "{name}: {near} near, {far} far");
    }
}
