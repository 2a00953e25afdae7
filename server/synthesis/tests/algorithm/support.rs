//! A hand, objects and givers that are simple enough to reason about.

use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use glam::{Quat, Vec3};
use grasp_synthesis::{
    base::{clock::Clock, pose::Pose},
    geometry::{Segment, mesh::TriangleMesh, mesh_bvh::MeshBvh},
    known::{recent_grips::RecentGrips, seed_source::SeedSource},
    base::mechanisms::Mechanisms,
    model::{
        constraints::Constraints,
        hand::{
            HandPose, Handedness,
            joints::HandJoints,
            rig::{AngleRange, DigitLimits, DigitRig, Rig, RigGuide},
        },
        holdout::{Holdout, PresentingHand},
        object::{GraspObject, THESIS_FRICTION},
        strategy::{Choice, Strategy},
    },
    search::settings::SearchSettings,
};

/// A clock that stands still until it is told to move.
#[derive(Debug, Default)]
pub(crate) struct FakeClock {
    nanoseconds: AtomicU64,
    /// Added by every look at the clock.
    pub(crate) tick: u64,
}

impl FakeClock {
    /// A clock that moves by `tick` nanoseconds whenever it is looked at.
    pub(crate) fn ticking(tick: u64) -> Self {
        Self {
            nanoseconds: AtomicU64::new(0),
            tick,
        }
    }

    /// How often it was looked at, if it ticks.
    pub(crate) fn looks(&self) -> u64 {
        self.nanoseconds.load(Ordering::SeqCst) / self.tick
    }
}

impl Clock for FakeClock {
    fn now(&self) -> Duration {
        Duration::from_nanos(self.nanoseconds.fetch_add(self.tick, Ordering::SeqCst))
    }
}

/// A right hand of 21 cm with the limits of Table 4.1: flat, the thumb at the side.
pub(crate) fn rig() -> Rig {
    let finger = |x: f32, y: f32, lengths: [f32; 3]| DigitRig {
        wrist_from_base: Pose::from_position(Vec3::new(x, y, 0.0)),
        yaw_sign: 1.0,
        lengths,
        diameters: [0.018, 0.016, 0.014],
        limits: DigitLimits {
            base_yaw: AngleRange::from_degrees(-5.0, 5.0),
            base_pitch: AngleRange::from_degrees(0.0, 90.0),
            second_pitch: AngleRange::from_degrees(0.0, 90.0),
            third_pitch: AngleRange::from_degrees(0.0, 60.0),
        },
    };
    // The thumb points up and to its side; its pad faces the palm's middle line.
    let along = Vec3::new(0.75, 0.65, 0.1).normalize_or(Vec3::Y);
    let pad =
        (Vec3::new(-0.5, 0.3, 0.8) - along * along.dot(Vec3::new(-0.5, 0.3, 0.8))).normalize_or(Vec3::Z);
    let thumb = DigitRig {
        wrist_from_base: Pose::new(
            Vec3::new(0.022, 0.028, 0.006),
            Quat::from_mat3(&glam::Mat3::from_cols(along.cross(pad), along, pad)),
        ),
        yaw_sign: -1.0,
        lengths: [0.045, 0.035, 0.028],
        diameters: [0.022, 0.019, 0.017],
        limits: DigitLimits {
            base_yaw: AngleRange::from_degrees(0.0, 45.0),
            base_pitch: AngleRange::from_degrees(0.0, 60.0),
            second_pitch: AngleRange::from_degrees(-45.0, 45.0),
            third_pitch: AngleRange::from_degrees(-30.0, 30.0),
        },
    };
    let palm_segments = std::array::from_fn(|index| {
        let x = 0.03 - 0.015 * (index % 5) as f32;
        let z = if index < 5 { 0.006 } else { -0.006 };
        Segment::new(Vec3::new(x * 0.6, 0.01, z), Vec3::new(x, 0.085, z))
    });
    Rig {
        name: "simple".into(),
        handedness: Handedness::Right,
        palm: Vec3::new(-0.003, 0.055, 0.013),
        reach: 0.21,
        digits: [
            thumb,
            finger(0.026, 0.088, [0.046, 0.028, 0.024]),
            finger(0.005, 0.09, [0.052, 0.034, 0.026]),
            finger(-0.016, 0.086, [0.047, 0.031, 0.025]),
            finger(-0.036, 0.08, [0.037, 0.022, 0.022]),
        ],
        finger_metacarpals: [0.014, 0.003, -0.009, -0.02].map(|x| Vec3::new(x, 0.02, 0.0)),
        palm_segments,
        joint_radii: [0.009; 26],
        guide: RigGuide::default(),
    }
}

/// A closed box with these half extents, each face split into `cells` by `cells` squares.
pub(crate) fn box_mesh(half: Vec3, cells: u32) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for (normal, right) in [
        (Vec3::X, Vec3::Y),
        (Vec3::NEG_X, Vec3::Z),
        (Vec3::Y, Vec3::Z),
        (Vec3::NEG_Y, Vec3::X),
        (Vec3::Z, Vec3::X),
        (Vec3::NEG_Z, Vec3::Y),
    ] {
        let up = normal.cross(right);
        let first = positions.len() as u32;
        for row in 0..=cells {
            for column in 0..=cells {
                let (u, v) = (
                    2.0 * column as f32 / cells as f32 - 1.0,
                    2.0 * row as f32 / cells as f32 - 1.0,
                );
                positions.push((normal + right * u + up * v) * half);
            }
        }
        for row in 0..cells {
            for column in 0..cells {
                let corner = first + row * (cells + 1) + column;
                let above = corner + cells + 1;
                triangles.push([corner, corner + 1, above + 1]);
                triangles.push([corner, above + 1, above]);
            }
        }
    }
    TriangleMesh::new(positions, triangles).expect("a box is a mesh")
}

/// A closed cylinder around the y axis.
pub(crate) fn cylinder_mesh(radius: f32, half_height: f32, sides: u32, rings: u32) -> TriangleMesh {
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..=rings {
        let y = half_height * (2.0 * ring as f32 / rings as f32 - 1.0);
        for side in 0..sides {
            let (sin, cos) = (std::f32::consts::TAU * side as f32 / sides as f32).sin_cos();
            positions.push(Vec3::new(radius * cos, y, radius * sin));
        }
    }
    let (bottom, top) = (positions.len() as u32, positions.len() as u32 + 1);
    positions.extend([
        Vec3::new(0.0, -half_height, 0.0),
        Vec3::new(0.0, half_height, 0.0),
    ]);
    for side in 0..sides {
        let next = (side + 1) % sides;
        for ring in 0..rings {
            let (low, high) = (ring * sides, (ring + 1) * sides);
            triangles.push([low + side, high + side, high + next]);
            triangles.push([low + side, high + next, low + next]);
        }
        triangles.push([bottom, side, next]);
        triangles.push([top, rings * sides + next, rings * sides + side]);
    }
    TriangleMesh::new(positions, triangles).expect("a cylinder is a mesh")
}

/// An object of 100 g whose centre of mass is its origin.
pub(crate) fn object(mesh: TriangleMesh, forbidden: &[u32]) -> GraspObject {
    GraspObject::new(mesh, 0.1, Vec3::ZERO, None, forbidden).expect("the object is sound")
}

/// A bar of 3 × 3 × 16 cm along y.
pub(crate) fn bar() -> GraspObject {
    object(box_mesh(Vec3::new(0.015, 0.08, 0.015), 6), &[])
}

/// An upright bar of which only the sides may be touched. Forces along their normals alone cannot lift it.
pub(crate) fn upright_bar_with_forbidden_ends() -> Holdout {
    let mesh = box_mesh(Vec3::new(0.015, 0.08, 0.015), 6);
    let ends: Vec<u32> = (0..mesh.triangles().len())
        .filter(|&triangle| mesh.normal(triangle).y.abs() > 0.9)
        .map(|triangle| triangle as u32)
        .collect();
    floating(object(mesh, &ends))
}

/// A plate of 10 × 7 × 0.8 cm.
pub(crate) fn plate() -> GraspObject {
    object(box_mesh(Vec3::new(0.05, 0.035, 0.004), 6), &[])
}

/// A rod of 2 × 18 cm along y.
pub(crate) fn rod() -> GraspObject {
    object(cylinder_mesh(0.01, 0.09, 24, 12), &[])
}

/// An object that floats.
pub(crate) fn floating(object: GraspObject) -> Holdout {
    Holdout {
        object: Arc::new(object),
        presenting_hand: None,
        up: Vec3::Y,
    }
}

/// An object whose lower end is held by a hand as simple as a box.
pub(crate) fn held(object: GraspObject) -> Holdout {
    let joints = HandJoints::of_pose(
        &rig(),
        &HandPose {
            frame_from_wrist: Pose::from_position(Vec3::new(0.0, -0.12, -0.03)),
            digits: rig().stretched(),
        },
    );
    let lump = box_mesh(Vec3::new(0.035, 0.03, 0.03), 4);
    let centre = Vec3::new(0.01, -0.07, -0.01);
    let positions = lump.positions().iter().map(|&p| p + centre).collect();
    let lump = TriangleMesh::new(positions, lump.triangles().to_vec()).expect("a box is a mesh");
    Holdout {
        object: Arc::new(object),
        presenting_hand: Some(PresentingHand {
            joints,
            surface: Some(MeshBvh::build(lump)),
            palm: Vec3::new(0.0, -0.06, -0.03),
        }),
        up: Vec3::new(0.28, 0.96, 0.0),
    }
}

/// A search that ends when it finds something.
pub(crate) fn settings(strategy: Strategy) -> SearchSettings {
    SearchSettings {
        seed: 20_231,
        strategy,
        validity: grasp_synthesis::model::strategy::Validity::Thesis,
        bend_ratios: strategy.default_bend_ratios(),
        friction: THESIS_FRICTION,
        reproducible: true,
        first_attempt: 0,
        max_attempts: 200_000,
        deadline: None,
        workers: 1,
        record_step_times: false,
        mechanisms: Mechanisms::ALL,
        constraints: Constraints::default(),
        choice: Choice::FirstValid,
        atlas: None,
        starts: SeedSource::Nothing,
        recent: RecentGrips::default(),
        known_tried: 0,
    }
}

/// A pool of some threads.
pub(crate) fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("the pool can be built")
}
