//! The centre of mass of an object that names none.

use glam::{DVec3, Vec3};
use grasp_synthesis::geometry::mesh::TriangleMesh;

/// Where a centre of mass came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Of the volume that the mesh encloses, of even density.
    Volume,
    /// Of the surface, of even thickness: the mesh encloses no volume to speak of.
    Surface,
}

/// Share of its bounding box that a mesh has to enclose for its volume to mean something. A sheet of paper encloses
/// less, and so does an open mesh whose signed tetrahedra cancel.
const SMALLEST_VOLUME_SHARE: f64 = 1e-4;

/// The centre of mass of a mesh, in metres: the volume's by the divergence theorem (the signed tetrahedra between
/// every triangle and one point), or the surface's where there is no volume, or where the volume's would lie outside
/// the mesh's bounding box, as it may for a mesh that is open or wound both ways.
pub(super) fn centre_of_mass(mesh: &TriangleMesh) -> (Vec3, Source) {
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for position in mesh.positions() {
        low = low.min(position.as_dvec3());
        high = high.max(position.as_dvec3());
    }
    // About the middle of the box: far from the origin the products would cancel.
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
    if volume.abs() > SMALLEST_VOLUME_SHARE * box_volume {
        let centre = volume_moment / volume + middle;
        if centre.cmpge(low).all() && centre.cmple(high).all() {
            return (centre.as_vec3(), Source::Volume);
        }
    }
    // Every triangle of a mesh has an area, so that the division is safe.
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
    fn a_box_far_from_the_origin_has_its_centre_in_its_middle() {
        let low = Vec3::new(10.0, -3.0, 7.0);
        let (centre, source) = centre_of_mass(&boxed(low, low + Vec3::new(0.1, 0.2, 0.3), false));
        assert_eq!(source, Source::Volume);
        assert!(
            (centre - (low + Vec3::new(0.05, 0.1, 0.15))).length() < 1e-5,
            "{centre}"
        );
    }

    #[test]
    fn a_tetrahedron_has_its_centre_at_the_mean_of_its_corners() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let mesh = TriangleMesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap();
        let (centre, source) = centre_of_mass(&mesh);
        assert_eq!(source, Source::Volume);
        assert!((centre - Vec3::splat(0.25)).length() < 1e-6);
    }

    #[test]
    fn a_flat_sheet_has_the_centre_of_its_surface() {
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let mesh = TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let (centre, source) = centre_of_mass(&mesh);
        assert_eq!(source, Source::Surface);
        assert!((centre - Vec3::new(0.5, 0.5, 0.0)).length() < 1e-6);
    }

    #[test]
    fn an_open_box_keeps_its_centre_inside() {
        let (centre, _) = centre_of_mass(&boxed(Vec3::ZERO, Vec3::ONE, true));
        assert!(
            centre.cmpge(Vec3::ZERO).all() && centre.cmple(Vec3::ONE).all(),
            "{centre}"
        );
    }
}
