//! The objects of a studio: those of the assets, each stretched by factors of its own, with givers who hold them.

use std::fmt::Write as _;

use glam::Vec3;
use grasp_assets::objects::objects;
use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{
    progress::bar,
    random_holdouts::{Givers, GivingHand, PlacedGiver, giving_hands, place},
};
use rand::{RngExt as _, SeedableRng as _, seq::SliceRandom as _};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Smallest and largest factor by which an object is stretched along an axis. Givers are placed on the unstretched shape, and
/// with more their hands would sink in or come off.
const STRETCH: [f32; 2] = [0.94, 1.06];

/// What all random draws start from.
const SEED: u64 = 0x5354_5544;

/// Objects, and how often each is asked for.
pub(crate) struct Studio {
    hands: Vec<GivingHand>,
    shapes: Vec<Shape>,
    objects: Vec<Object>,
    /// The chances of the objects, summed up.
    cumulative: Vec<f64>,
}

struct Shape {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    mass: f32,
    friction: Option<f32>,
    givers: Vec<PlacedGiver>,
}

struct Object {
    shape: usize,
    stretch: Vec3,
}

impl Studio {
    /// So many objects, asked for in proportion to 1/n to the power `exponent`, with so many givers per shape.
    pub(crate) fn new(count: usize, exponent: f64, givers: u64) -> Self {
        let hands = giving_hands();
        let bar = bar(objects().len(), "placing givers".to_owned());
        let shapes = objects().iter().map(|built_in| {
            let object = &built_in.object;
            let mesh = object.surface.mesh();
            bar.inc(1);
            Shape {
                positions: mesh.positions().to_vec(),
                triangles: mesh.triangles().to_vec(),
                mass: object.mass,
                friction: object.friction,
                givers: (0..givers).map(|seed| place(object, &hands, seed)).collect(),
            }
        });
        let shapes: Vec<Shape> = shapes.collect();
        bar.finish_and_clear();
        let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
        let mut objects: Vec<Object> = (0..count)
            .map(|number| Object {
                shape: number % shapes.len(),
                stretch: Vec3::from_array(std::array::from_fn(|_| {
                    random.random_range(STRETCH[0]..STRETCH[1])
                })),
            })
            .collect();
        objects.shuffle(&mut random);
        let mut sum = 0.0;
        let cumulative = (1..=count).map(|place| {
            sum += (place as f64).powf(-exponent);
            sum
        });
        Self {
            cumulative: cumulative.collect(),
            hands,
            shapes,
            objects,
        }
    }

    /// The number of objects.
    pub(crate) fn len(&self) -> usize {
        self.objects.len()
    }

    /// The request that creates an object.
    pub(crate) fn creation(&self, place: usize) -> v1::CreateObjectRequest {
        let Object { shape, stretch } = &self.objects[place];
        let shape = &self.shapes[*shape];
        let mut mesh = String::new();
        for position in &shape.positions {
            let Vec3 { x, y, z } = position * stretch;
            // Writing to a string cannot fail.
            let _ = writeln!(mesh, "v {x} {y} {z}");
        }
        for [a, b, c] in &shape.triangles {
            let _ = writeln!(mesh, "f {} {} {}", a + 1, b + 1, c + 1);
        }
        let mut request = v1::CreateObjectRequest::new(id(place), mesh, shape.mass);
        request.object_mut().friction = shape.friction;
        request
    }

    /// A request for an object that is drawn by how often each is asked for, in the hands of a random giver.
    pub(crate) fn draw(&self, random: &mut Xoshiro256PlusPlus) -> v1::FindGraspRequest {
        let sum = self.cumulative.last().copied().unwrap_or_default();
        let drawn = random.random_range(0.0..sum);
        let place = self.cumulative.partition_point(|&end| end <= drawn);
        let Object { shape, stretch } = &self.objects[place];
        let placed = &self.shapes[*shape].givers;
        let giver = &placed[random.random_range(0..placed.len())];
        let wrist = giver.object_from_wrist;
        let stretched = PlacedGiver {
            object_from_wrist: Pose::new(wrist.position * stretch, wrist.orientation),
            ..giver.clone()
        };
        let givers = Givers::new(&self.hands, &[stretched]).expect("the hand is one of them");
        givers.draw(random).request(&format!("objects/{}", id(place)))
    }
}

fn id(place: usize) -> String {
    format!("studio-{place}")
}
