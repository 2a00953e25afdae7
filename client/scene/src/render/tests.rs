//! Pictures against closed forms.

use std::f32::consts::PI;

use super::*;
use crate::{
    primitives::{arrow, capsule, sphere},
    scene::Part,
};

const RED: [f32; 4] = [0.6, 0.02, 0.02, 1.0];
const BLUE: [f32; 4] = [0.02, 0.02, 0.6, 1.0];

fn options() -> RenderOptions {
    RenderOptions {
        width: 120,
        height: 90,
        ground_shadow: false,
        ..RenderOptions::default()
    }
}

fn looking_along_minus_z(distance: f32) -> Camera {
    let mut camera = Camera::framing_points([Vec3::ZERO], Vec3::Z, Vec3::Y, 4.0 / 3.0);
    camera.world_from_camera.position = Vec3::new(0.0, 0.0, distance);
    camera
}

fn scene(parts: impl IntoIterator<Item = Part>) -> Scene {
    Scene {
        parts: parts.into_iter().collect(),
    }
}

#[test]
fn sphere_covers_the_area_of_its_outline() {
    let (radius, distance) = (0.1, 0.7);
    let camera = looking_along_minus_z(distance);
    let triangles = triangles_of(&scene([sphere("ball", Vec3::ZERO, radius, RED)]));
    let frame = Frame {
        camera: &camera,
        width: 400,
        height: 300,
        grid: 2,
        triangles: &triangles,
    };
    let covered = frame
        .coverage(|_| true)
        .ids
        .iter()
        .filter(|&&id| id != NOTHING)
        .count();
    // The tangent cone of a ball meets the plane at distance 1 in a circle of radius r / sqrt(d² - r²).
    let outline = PI * radius * radius / (distance * distance - radius * radius);
    let tangents = camera.tangents();
    let share = outline / (4.0 * tangents.x * tangents.y);
    let measured = covered as f32 / (800.0 * 600.0);
    assert!((measured / share - 1.0).abs() < 0.01, "{measured} is not {share}");
}

#[test]
fn nearer_parts_hide_farther_ones() {
    let front = sphere("front", Vec3::new(0.0, 0.0, 0.1), 0.05, RED);
    let back = sphere("back", Vec3::new(0.0, 0.0, -0.1), 0.05, BLUE);
    for parts in [[front.clone(), back.clone()], [back, front]] {
        let scene = scene(parts);
        let camera = |direction| Camera::framing(&scene, direction, Vec3::Y, 4.0 / 3.0);
        let [r, _, b] = render(&scene, &camera(Vec3::Z), options()).pixel(60, 45);
        assert!(r > 2 * b, "red {r} is in front of blue {b}");
        let [r, _, b] = render(&scene, &camera(Vec3::NEG_Z), options()).pixel(60, 45);
        assert!(b > 2 * r, "blue {b} is in front of red {r}");
    }
}

#[test]
fn winding_does_not_change_the_picture() {
    let corners = vec![
        Vec3::new(-0.1, -0.1, 0.0),
        Vec3::new(0.1, -0.1, 0.02),
        Vec3::new(0.0, 0.1, 0.0),
    ];
    let camera = looking_along_minus_z(0.5);
    let outward = scene([Part::new("a", corners.clone(), vec![[0, 1, 2]], RED)]);
    let inward = scene([Part::new("a", corners, vec![[0, 2, 1]], RED)]);
    let (a, b) = (
        render(&outward, &camera, options()),
        render(&inward, &camera, options()),
    );
    let furthest = a.rgb().iter().zip(b.rgb()).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(furthest <= Some(1), "differs by {furthest:?}");
    assert_ne!(
        a.pixel(60, 45),
        render(&Scene::default(), &camera, options()).pixel(60, 45)
    );
}

#[test]
fn number_of_threads_does_not_change_the_bytes() {
    let scene = scene([
        sphere("ball", Vec3::ZERO, 0.05, RED).with_finish(Finish::Metal),
        capsule(
            "rod",
            Vec3::new(-0.1, 0.03, 0.0),
            Vec3::new(0.1, 0.0, 0.06),
            0.02,
            BLUE,
        )
        .with_finish(Finish::Skin),
        arrow(
            "arrow",
            Vec3::new(0.0, 0.2, 0.0),
            Vec3::new(0.0, 0.05, 0.0),
            0.004,
            RED,
        )
        .with_finish(Finish::Marker),
    ]);
    let draw = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| render_png(&scene, Vec3::new(1.0, 0.5, 0.7), options()))
    };
    let one = draw(1);
    assert!(draw(2) == one && draw(5) == one);
}

#[test]
fn half_transparency_is_the_mean_of_both_colours() {
    let camera = looking_along_minus_z(0.5);
    let behind = sphere("behind", Vec3::new(0.0, 0.0, -0.3), 0.15, BLUE).with_finish(Finish::Marker);
    let pane = |alpha: f32| {
        let mut pane = sphere("pane", Vec3::ZERO, 0.05, [0.6, 0.6, 0.02, alpha]);
        pane.finish = Finish::Cloth;
        let mut behind = behind.clone();
        behind.finish = Finish::Cloth;
        let settings = RenderOptions {
            supersampling: 4,
            ..options()
        };
        render(&scene([behind, pane]), &camera, settings).pixel(60, 45)
    };
    let (clear, half, solid) = (pane(0.0), pane(0.5), pane(1.0));
    assert!(
        clear[2] > 100 && clear[0] < 90 && solid[0] > 100 && solid[2] < 90,
        "{clear:?} {solid:?}"
    );
    assert!(
        half[0] > clear[0] + 30 && half[0] + 15 < solid[0],
        "{clear:?} {half:?} {solid:?}"
    );
    assert!(
        half[2] > solid[2] + 30 && half[2] + 15 < clear[2],
        "{clear:?} {half:?} {solid:?}"
    );
}

#[test]
fn hidden_markers_are_faintly_visible() {
    let camera = looking_along_minus_z(0.5);
    let ball = sphere("ball", Vec3::ZERO, 0.05, BLUE);
    let mark = |z: f32| sphere("mark", Vec3::new(0.0, 0.0, z), 0.01, RED).with_finish(Finish::Marker);
    let red_with = |parts: Vec<Part>| render(&scene(parts), &camera, options()).pixel(60, 45)[0];
    let none = red_with(vec![ball.clone()]);
    let hidden = red_with(vec![ball.clone(), mark(0.0)]);
    let shown = red_with(vec![ball, mark(0.06)]);
    assert!(
        hidden > none + 10 && shown > hidden + 30,
        "{none} < {hidden} < {shown}"
    );
}

#[test]
fn parts_cast_shadows_and_occlude_corners() {
    // A ball above a slab, seen from above; the light comes from the picture's upper left.
    let slab = Part::new(
        "slab",
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, z)| Vec3::new(x * 0.3, 0.0, z * 0.3))
            .to_vec(),
        vec![[0, 2, 1], [0, 3, 2]],
        [0.4, 0.4, 0.4, 1.0],
    );
    let ball = sphere("ball", Vec3::new(0.0, 0.03, 0.0), 0.03, RED);
    let mut camera = Camera::framing_points([Vec3::ZERO], Vec3::Y, Vec3::NEG_Z, 4.0 / 3.0);
    camera.world_from_camera.position = Vec3::new(0.0, 0.6, 0.0);
    let brightness = |parts: Vec<Part>, at: Vec3| {
        let image = render(&scene(parts), &camera, options());
        let place = camera.project(at).expect("in front") * Vec3::new(120.0, 90.0, 1.0);
        i32::from(image.pixel(place.x as usize, place.y as usize)[1])
    };
    // Right of and below the ball, away from the light.
    let shaded = Vec3::new(0.035, 0.0, 0.045);
    let open = Vec3::new(-0.08, 0.0, -0.09);
    let alone = brightness(vec![slab.clone()], shaded);
    let below = brightness(vec![slab.clone(), ball.clone()], shaded);
    assert!(below + 40 < alone, "{below} is not darker than {alone}");
    let difference = brightness(vec![slab.clone(), ball], open) - brightness(vec![slab], open);
    assert!(difference.abs() <= 3, "open ground changed by {difference}");
}

#[test]
fn ground_is_darker_below_parts() {
    let scene = scene([sphere("ball", Vec3::ZERO, 0.05, RED)]);
    let mut camera = Camera::framing(&scene, Vec3::new(0.0, 0.7, 1.0), Vec3::Y, 4.0 / 3.0);
    camera.vertical_fov *= 2.0;
    let with = render(
        &scene,
        &camera,
        RenderOptions {
            ground_shadow: true,
            ..options()
        },
    );
    let without = render(&scene, &camera, options());
    let below = camera.project(Vec3::new(0.0, -0.056, 0.0)).expect("in front");
    let (x, y) = (60, (below.y * 90.0) as usize);
    assert!(with.pixel(x, y + 8)[0] + 15 < without.pixel(x, y + 8)[0]);
    assert_eq!(with.pixel(2, 2), without.pixel(2, 2));
}

#[test]
fn empty_scene_is_a_backdrop() {
    let image = render(&Scene::default(), &looking_along_minus_z(1.0), options());
    assert_eq!((image.width(), image.height()), (120, 90));
    assert!(image.rgb().iter().all(|&value| value > 200));
}
