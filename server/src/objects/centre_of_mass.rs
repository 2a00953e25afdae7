//! The centre of mass of an object that gives none.

use glam::{DVec3, Vec3};
use grasp_synthesis::geometry::mesh::TriangleMesh;

/// What a centre of mass was computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    /// The volume that the mesh encloses, at uniform density.
    Volume,
    /// The surface, at uniform thickness: the mesh encloses almost no volume.
    Surface,
}

/// Smallest enclosed share of the bounding box for which the volume is used. A sheet of paper encloses less, and so
/// does an open mesh whose signed tetrahedra cancel.
const MIN_VOLUME_SHARE: f64 = 1e-4;

/// The warning about a centre of mass that was computed from the surface.
const SURFACE_WARNING: &str = "the mesh encloses no volume: the centre of mass is that of its surface";

/// The given centre of mass or, without one, that of the mesh, in metres. Adds a warning if the latter is that of the
/// surface, and removes one from before.
pub(super) fn centre_or_computed(
    mesh: &TriangleMesh,
    given: Option<Vec3>,
    warnings: &mut Vec<String>,
) -> Vec3 {
    warnings.retain(|warning| warning != SURFACE_WARNING);
    given.unwrap_or_else(|| {
        let (centre, source) = centre_of_mass(mesh);
        if source == Source::Surface {
            warnings.push(SURFACE_WARNING.to_owned());
        }
        centre
    })
}

/// The centre of mass of a mesh, in metres: that of the volume, by the divergence theorem (signed tetrahedra between
/// every triangle and one point). It is that of the surface if there is no volume, or if the volume's would be outside
/// the bounding box, as it may be for a mesh that is open or has inconsistent winding.
fn centre_of_mass(mesh: &TriangleMesh) -> (Vec3, Source) {
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for position in mesh.positions() {
        low = low.min(position.as_dvec3());
        high = high.max(position.as_dvec3());
    }
    // Relative to the middle of the box: far from the origin, the products would lose precision.
    let middle = (low + high) * 0.5;
    let (mut volume, mut volume_moment) = (0.0, DVec3::ZERO);
    let (mut area, mut area_moment) = (0.0, DVec3::ZERO);
    for triangle in 0..mesh.triangles().len() {
        let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3() - middle);
        let tetrahedron = a.dot(b.cross(c)) / 6.0;
        volume += tetrahedron;
        volume_moment += tetrahedron * (a + b + c) / 4.0;
        let surface = (b - a).cross(c - a).length() / 2.0;
        area += surface;
        area_moment += surface * (a + b + c) / 3.0;
    }
    let box_volume = (high - low).element_product();
    if volume.abs() > MIN_VOLUME_SHARE * box_volume {
        let centre = volume_moment / volume + middle;
        if centre.cmpge(low).all() && centre.cmple(high).all() {
            return (centre.as_vec3(), Source::Volume);
        }
    }
    // Every triangle of a mesh has an area: no division by 0.
    ((area_moment / area + middle).as_vec3(), Source::Surface)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(low: Vec3, high: Vec3, without_lid: bool) -> TriangleMesh {
        let corner = |i: usize| {
            Vec3::new(
                if i & 1 == 0 { low.x } else { high.x },
                if i & 2 == 0 { low.y } else { high.y },
                if i & 4 == 0 { low.z } else { high.z },
            )
        };
        let mut triangles = vec![
            [0, 2, 1],
            [1, 2, 3],
            [0, 1, 4],
            [1, 5, 4],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
            [2, 6, 3],
            [3, 6, 7],
        ];
        if !without_lid {
            triangles.extend([[4, 5, 6], [5, 7, 6]]);
        }
        TriangleMesh::new((0..8).map(corner).collect(), triangles).unwrap()
    }

    #[test]
    fn centre_of_a_box_far_from_the_origin_is_its_middle() {
        let low = Vec3::new(10.0, -3.0, 7.0);
        let (centre, source) = centre_of_mass(&boxed(low, low + Vec3::new(0.1, 0.2, 0.3), false));
        assert_eq!(source, Source::Volume);
        assert!(
            (centre - (low + Vec3::new(0.05, 0.1, 0.15))).length() < 1e-5,
            "{centre}"
        );
    }

    #[test]
    fn centre_of_a_tetrahedron_is_the_mean_of_its_corners() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let mesh = TriangleMesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap();
        let (centre, source) = centre_of_mass(&mesh);
        assert_eq!(source, Source::Volume);
        assert!((centre - Vec3::splat(0.25)).length() < 1e-6);
    }

    #[test]
    fn centre_of_a_sheet_is_that_of_its_surface() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let mesh = TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let (centre, source) = centre_of_mass(&mesh);
        assert_eq!(source, Source::Surface);
        assert!((centre - Vec3::new(0.5, 0.5, 0.0)).length() < 1e-6);
    }

    #[test]
    fn centre_of_an_open_box_is_inside() {
        let (centre, _) = centre_of_mass(&boxed(Vec3::ZERO, Vec3::ONE, true));
        assert!(
            centre.cmpge(Vec3::ZERO).all() && centre.cmple(Vec3::ONE).all(),
            "{centre}"
        );
    }
}
