//! Polygons are covered once by their triangles, wherever they lie and whatever their shape.

use glam::{DVec2, DVec3, Quat, Vec3};
use proptest::{
    collection::vec,
    prelude::*,
    test_runner::{RngAlgorithm, RngSeed},
};

use crate::{
    ImportedMesh,
    tests::{corners, read, repair::Polygons},
};

/// Largest error of an area relative to the square of the mesh's extent: rounding of positions to `f32`.
const AREA_ERROR: f64 = 1e-5;

/// Twice the area of a polygon as a vector along its normal, by the shoelace formula.
fn shoelace(corners: &[DVec3]) -> DVec3 {
    (0..corners.len())
        .map(|k| corners[k].cross(corners[(k + 1) % corners.len()]))
        .sum()
}

/// Asserts that the triangles of each face have the face's winding, and together its area. A polygon that folds over
/// itself has triangles of both windings, or more area.
fn assert_areas_match(polygons: &Polygons, read: &ImportedMesh) {
    let vertices = polygons.0.iter().flatten();
    let extent = vertices.map(|vertex| vertex.length()).fold(0.0, f64::max);
    let tolerance = AREA_ERROR * extent * extent;
    let mut first = 0;
    for (number, face) in polygons.0.iter().enumerate() {
        let expected = shoelace(face);
        let normal = expected.normalize_or(DVec3::Z);
        let last = first + face.len() - 2;
        let mut area = 0.0;
        for (triangle, &index) in read.indices_in_file.iter().enumerate() {
            if !(first..last).contains(&(index as usize)) {
                continue;
            }
            let [a, b, c] = read.mesh.corners(triangle).map(Vec3::as_dvec3);
            let twice = (b - a).cross(c - a).dot(normal);
            assert!(
                twice >= -tolerance,
                "a triangle of face {number} is turned over: {twice}"
            );
            area += twice;
        }
        let expected = expected.length();
        assert!(
            (area - expected).abs() <= tolerance,
            "face {number}: {area}, not {expected}"
        );
        first = last;
    }
    assert_eq!(read.triangles_in_file, first);
}

/// Asserts that no triangle reaches out of the polygon: that points of each lie inside.
fn assert_inside(outline: &[DVec2], plane: Plane, read: &ImportedMesh) {
    for triangle in corners(read) {
        let [a, b, c] = triangle.map(|corner| plane.flatten(corner));
        for weights in [[1.0, 1.0, 1.0], [8.0, 1.0, 1.0], [1.0, 8.0, 1.0], [1.0, 1.0, 8.0]] {
            let [u, v, w] = weights;
            let point = (a * u + b * v + c * w) / (u + v + w);
            let distances = sides(outline).map(|(a, b)| distance(point, a, b));
            let distance = distances.fold(f64::INFINITY, f64::min);
            assert!(
                distance < 1e-5 || is_inside(outline, point),
                "{point} of {triangle:?} is {distance} outside of {outline:?}"
            );
        }
    }
}

fn distance(point: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = ((point - a).dot(b - a) / (b - a).length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    point.distance(a + (b - a) * along)
}

fn sides(outline: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> {
    let ends = outline.iter().copied().cycle().skip(1);
    outline.iter().copied().zip(ends)
}

/// Whether a ray from the point crosses the outline an odd number of times.
fn is_inside(outline: &[DVec2], point: DVec2) -> bool {
    let crossed = sides(outline).filter(|(a, b)| {
        (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossed.count() % 2 == 1
}

/// A plane in space.
#[derive(Clone, Copy, Debug)]
struct Plane {
    orientation: Quat,
    origin: Vec3,
}

impl Plane {
    fn any() -> impl Strategy<Value = Self> {
        let vector = || [-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0];
        (vector(), 0.0_f32..6.3, vector()).prop_map(|(axis, angle, origin)| Self {
            orientation: Quat::from_axis_angle(Vec3::from(axis).normalize_or(Vec3::X), angle),
            origin: Vec3::from(origin),
        })
    }

    /// The plane z = 0.
    const FLAT: Self = Self {
        orientation: Quat::IDENTITY,
        origin: Vec3::ZERO,
    };

    fn lift(self, point: DVec2) -> Vec3 {
        self.orientation * point.extend(0.0).as_vec3() + self.origin
    }

    fn flatten(self, point: Vec3) -> DVec2 {
        let local = self.orientation.inverse() * (point - self.origin);
        local.as_dvec3().truncate()
    }
}

/// One polygon in a plane, of vertices in single precision.
fn polygon(outline: &[DVec2], plane: Plane) -> Polygons {
    let corners = outline.iter().map(|&point| plane.lift(point).as_dvec3());
    Polygons(vec![corners.collect()])
}

fn is_crossed(read: &ImportedMesh) -> bool {
    read.warnings.iter().any(|warning| warning.contains("intersect"))
}

fn assert_areas_covered(outline: &[DVec2], plane: Plane) -> ImportedMesh {
    let polygon = polygon(outline, plane);
    let read = read(polygon.obj()).unwrap();
    assert!(!is_crossed(&read), "{:?}", read.warnings);
    assert_areas_match(&polygon, &read);
    read
}

/// A simple polygon: random points, whose tour is untangled by reversing parts of it as long as that shortens it.
fn simple_polygon() -> impl Strategy<Value = Vec<DVec2>> {
    vec((-1.0_f64..1.0, -1.0_f64..1.0).prop_map(DVec2::from), 4..40).prop_map(|mut tour| {
        let count = tour.len();
        let mut improved = true;
        while improved {
            improved = false;
            for i in 0..count - 1 {
                for j in i + 2..count {
                    let next = (j + 1) % count;
                    if next == i {
                        continue;
                    }
                    let now = tour[i].distance(tour[i + 1]) + tour[j].distance(tour[next]);
                    let then = tour[i].distance(tour[j]) + tour[i + 1].distance(tour[next]);
                    if then < now - 1e-12 {
                        tour[i + 1..=j].reverse();
                        improved = true;
                    }
                }
            }
        }
        tour
    })
}

/// The polygon with corners on its sides, which in `f32` are only nearly collinear, and some corners twice.
fn with_more_corners(outline: &[DVec2], extra: &[u8]) -> Vec<DVec2> {
    let mut more = Vec::new();
    for (k, &corner) in outline.iter().enumerate() {
        more.push(corner);
        let next = outline[(k + 1) % outline.len()];
        match extra[k % extra.len()] {
            0 => more.push(corner),
            1 => more.push(corner.midpoint(next)),
            2 => more.extend([corner.lerp(next, 0.2), corner.lerp(next, 0.5)]),
            _ => {}
        }
    }
    more
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 1000,
        failure_persistence: None,
        rng_algorithm: RngAlgorithm::ChaCha,
        rng_seed: RngSeed::Fixed(0x0B2),
        ..ProptestConfig::default()
    })]

    #[test]
    fn covers_simple_polygons_in_any_plane_with_collinear_and_repeated_corners(
        outline in simple_polygon(),
        extra in vec(0..5_u8, 1..8),
        plane in Plane::any(),
        start: prop::sample::Index,
        reversed: bool,
    ) {
        let mut outline = with_more_corners(&outline, &extra);
        if reversed {
            outline.reverse();
        }
        let start = start.index(outline.len());
        outline.rotate_left(start);
        let read = assert_areas_covered(&outline, plane);
        assert_inside(&outline, plane, &read);
    }

    #[test]
    fn covers_strips_with_holes_at_bridges(
        holes in vec(([0.1_f64..0.4, 0.1_f64..0.4], [0.5_f64..0.9, 0.5_f64..0.9]), 1..6),
        plane in Plane::any(),
        start: prop::sample::Index,
        reversed: bool,
    ) {
        // Each unit of the strip has a rectangular hole, reached from the lower side over a side that is passed twice.
        let mut outline = vec![DVec2::ZERO];
        let mut area = holes.len() as f64;
        for (place, &([left, low], [right, high])) in holes.iter().enumerate() {
            let corner = |x: f64, y: f64| DVec2::new(place as f64 + x, y);
            let entry = corner(left, low);
            let hole = [entry, corner(left, high), corner(right, high), corner(right, low), entry];
            outline.push(corner(left, 0.0));
            outline.extend(hole);
            outline.push(corner(left, 0.0));
            area -= (right - left) * (high - low);
        }
        let length = holes.len() as f64;
        outline.extend([DVec2::new(length, 0.0), DVec2::new(length, 1.0), DVec2::new(0.0, 1.0)]);
        if reversed {
            outline.reverse();
        }
        let start = start.index(outline.len());
        outline.rotate_left(start);
        let read = assert_areas_covered(&outline, plane);
        let covered: f64 = (0..read.mesh.triangles().len())
            .map(|triangle| {
                let [a, b, c] = read.mesh.corners(triangle).map(Vec3::as_dvec3);
                (b - a).cross(c - a).length() / 2.0
            })
            .sum();
        prop_assert!((covered - area).abs() < 1e-5 * length * length, "{} is not {}", covered, area);
    }

    #[test]
    fn covers_polygons_on_a_grid(
        outline in simple_polygon(),
        extra in vec(0..5_u8, 1..8),
    ) {
        // Exact coordinates: corners are exactly collinear, and sides touch or coincide.
        let snapped: Vec<_> = outline.iter().map(|point| (point * 4.0).round()).collect();
        let snapped = with_more_corners(&snapped, &extra);
        let polygon = polygon(&snapped, Plane::FLAT);
        if let Ok(read) = read(polygon.obj()) && !is_crossed(&read) {
            assert_areas_match(&polygon, &read);
        }
    }
}

#[test]
fn corners_on_straight_sides_stay_joined_to_the_neighbouring_face() {
    // Two concave faces share a straight side with a corner that both have.
    let [upper, lower] = [
        [(0, 0), (2, 0), (4, 0), (4, 4), (2, 1), (0, 4)],
        [(4, 0), (2, 0), (0, 0), (0, -4), (2, -1), (4, -4)],
    ]
    .map(|corners| {
        corners
            .map(|(x, y): (i32, i32)| DVec3::new(x.into(), y.into(), 0.0))
            .to_vec()
    });
    let polygons = Polygons(vec![upper, lower]);
    let read = read(polygons.obj()).unwrap();
    assert_areas_match(&polygons, &read);
    let open = "8 edges are open: the surface has holes and its volume is an estimate; the first is at the face on line 7";
    assert_eq!(read.warnings, [open]);
}

#[test]
fn covers_a_spiral_of_thousands_of_corners() {
    let turns = |k: u32, inner: f64| {
        let angle = f64::from(k) * 0.05;
        DVec2::from_angle(angle) * (0.1 + 0.01 * angle + inner)
    };
    let outer = (0..1500).map(|k| turns(k, 0.03));
    let spiral: Vec<_> = outer.chain((0..1500).rev().map(|k| turns(k, 0.0))).collect();
    let plane = Plane {
        orientation: Quat::from_rotation_x(0.4),
        origin: Vec3::new(0.1, 0.2, 0.3),
    };
    assert_areas_covered(&spiral, plane);
}

#[test]
fn warped_polygon_is_covered_as_seen_along_its_normal() {
    let outline = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)]
        .map(|(x, y): (i32, i32)| DVec2::new(x.into(), y.into()));
    for start in 0..outline.len() {
        let mut turned = outline;
        turned.rotate_left(start);
        let warped = turned.map(|point| point.extend(0.02 * point.x * point.y - 0.01 * point.x * point.x));
        let read = read(Polygons(vec![warped.to_vec()]).obj()).unwrap();
        let areas = corners(&read)
            .into_iter()
            .map(|[a, b, c]| (b - a).cross(c - a).z / 2.0);
        let areas: Vec<f32> = areas.collect();
        assert!(areas.iter().all(|&area| area > 0.0), "{start}: {areas:?}");
        assert!(
            (areas.iter().sum::<f32>() - 7.0).abs() < 1e-5,
            "{start}: {areas:?}"
        );
    }
}

#[test]
fn spikes_and_repeated_corners_have_no_area() {
    // An L whose corners repeat, with a spike of no width at its end.
    let outline = [
        (0, 0),
        (2, 0),
        (5, 0),
        (2, 0),
        (2, 1),
        (2, 1),
        (1, 1),
        (1, 2),
        (0, 2),
    ];
    for start in 0..outline.len() {
        let mut turned = outline.map(|(x, y): (i32, i32)| DVec2::new(x.into(), y.into()));
        turned.rotate_left(start);
        let read = assert_areas_covered(&turned, Plane::FLAT);
        assert_eq!(read.mesh.area(), 3.0, "{start}");
    }
}

#[test]
fn polygons_that_intersect_themselves_stay_fans_with_a_warning() {
    let uneven_bow_tie = [(0.0, 0.0), (3.0, 3.0), (3.0, 0.0), (0.0, 2.0)].map(DVec2::from);
    let bow_tie = [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)].map(DVec2::from);
    let star: [DVec2; 5] = std::array::from_fn(|k| DVec2::from_angle(0.8 * std::f64::consts::PI * k as f64));
    for crossed in [&uneven_bow_tie[..], &bow_tie, &star] {
        let found = read(polygon(crossed, Plane::FLAT).obj()).unwrap();
        let fan = (2..crossed.len()).map(|k| [0, k - 1, k].map(|k| Plane::FLAT.lift(crossed[k])));
        assert_eq!(corners(&found), fan.collect::<Vec<_>>());
        let texts = "1 polygons intersect themselves; their fans of triangles overlap; the first is on line ";
        assert!(found.warnings[0].starts_with(texts), "{:?}", found.warnings);
    }
}
