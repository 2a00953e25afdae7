//! Boxes with known grips, for objects that have no atlas yet: an object about as long, wide and thick as a box can mostly be held
//! where the box can. A search for an object without an atlas starts from the grips that fit it ([`TransferredGrips`]). Choosing
//! grasps by shape primitives follows A. T. Miller, S. Knoop, H. I. Christensen and P. K. Allen, "Automatic Grasp Planning Using
//! Shape Primitives", ICRA 2003, with tested grips instead of their rules.

use std::sync::Arc;

use glam::{Mat3, Quat, Vec3};

use super::atlas::Grips;
use crate::{
    base::{
        pose::Pose,
        stop::{Stop, Stopped, unstopped},
    },
    geometry::{boxes::OrientedBox, mesh::TriangleMesh},
    model::{grasp::Contact, object::GraspObject, strategy::Validity},
    physical::{
        barriers::Barriers,
        contacts::{FACING_COS, soften},
        grip::FORBIDDEN_CLEARANCE,
        immobility::{Buffers, SoftContact, epsilon_upper_bound},
        presented::ObjectScene,
    },
    rating::{assessment::GraspContext, scoring::middle},
};

/// A box with its longest edges along x and its shortest along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primitive {
    /// Half of its edge lengths, in metres.
    pub half_extents: Vec3,
}

/// Mass of a box, in kilograms: typical of objects held in one hand. Grips are checked again with the object's own mass.
const MASS: f32 = 0.1;

impl Primitive {
    /// All boxes with known grips. They are dense where thickness decides which fingers reach around: from blades and handles over
    /// pens and bars to a phone, and one as wide as a mug. Easy objects need none.
    pub const ALL: [Self; 12] = [
        Self::of_millimetres(160, 10, 5),
        Self::of_millimetres(160, 12, 3),
        Self::of_millimetres(160, 20, 6),
        Self::of_millimetres(160, 26, 4),
        Self::of_millimetres(160, 18, 18),
        Self::of_millimetres(160, 32, 14),
        Self::of_millimetres(160, 40, 8),
        Self::of_millimetres(160, 40, 20),
        Self::of_millimetres(150, 70, 8),
        Self::of_millimetres(160, 70, 24),
        Self::of_millimetres(100, 24, 10),
        Self::of_millimetres(120, 76, 76),
    ];

    /// A box with these edge lengths.
    const fn of_millimetres(length: u16, width: u16, thickness: u16) -> Self {
        Self {
            half_extents: Vec3::new(
                length as f32 / 2000.0,
                width as f32 / 2000.0,
                thickness as f32 / 2000.0,
            ),
        }
    }

    /// Its edge lengths in millimetres, such as "box-160x10x5".
    pub fn name(self) -> String {
        let [length, width, thickness] = (self.half_extents * 2000.0).to_array().map(f32::round);
        format!("box-{length}x{width}x{thickness}")
    }

    /// The box as an object, centred on the origin.
    ///
    /// # Panics
    /// If an edge is not a positive number; never for those of [`Primitive::ALL`].
    pub fn object(self) -> GraspObject {
        let corner = |k: usize| {
            let side = |axis: usize| if k >> axis & 1 == 0 { -1.0 } else { 1.0 };
            self.half_extents * Vec3::new(side(0), side(1), side(2))
        };
        let faces = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let mesh = TriangleMesh::new((0..8).map(corner).collect(), triangles.collect());
        mesh.ok()
            .and_then(|mesh| GraspObject::new(mesh, MASS, Vec3::ZERO, None, &[]).ok())
            .expect("a box with edges is an object")
    }
}

/// A box with a hand's grips on it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldPrimitive {
    /// The box.
    pub primitive: Primitive,
    /// The grips, in the frame of the box.
    pub grips: Grips,
}

/// Largest number of transferred grips, the best fitting ones.
const MAX_GRIPS: usize = 1024;

/// Number of boxes that grips are transferred from, the most similar ones.
const NEAREST_BOXES: usize = 5;

/// Largest distance of thumb and finger from the surface, in metres.
const MAX_CONTACT_OFFSET: f32 = 0.002;

/// Grips transferred to the object between two checks of the stop.
const MOVES_PER_CHECK: usize = 32;

/// Smallest size in comparisons, in metres: logarithms need a positive one.
const MIN_SIZE: f32 = 0.001;

/// Distance within which a contact is projected onto the surface, in metres: closing the digits makes up for it.
const SNAP_DISTANCE: f32 = 0.004;

/// Cosine of the largest angle between a contact's normal and the surface's: 45°.
const SCREEN_COS: f32 = 0.7;

/// The rotations that map a box onto itself: identity, and half a turn about each axis.
const TURNS: [Quat; 4] = [
    Quat::IDENTITY,
    Quat::from_xyzw(1.0, 0.0, 0.0, 0.0),
    Quat::from_xyzw(0.0, 1.0, 0.0, 0.0),
    Quat::from_xyzw(0.0, 0.0, 1.0, 0.0),
];

/// A grip of a box on the object. Its pose is derived when needed, which saves memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Transferred {
    primitive: u8,
    turn: u8,
    grip: u16,
    passes_screen: bool,
}

impl Transferred {
    fn contacts(self, held: &HeldPrimitive) -> &[Contact] {
        &held.grips.entries()[usize::from(self.grip)].contacts
    }
}

/// Grips of boxes that fit an object, as far as contact positions show. They are known to hold the boxes, not the object:
/// searches use them as seeds.
#[derive(Clone, Debug)]
pub struct TransferredGrips {
    known: Arc<[HeldPrimitive]>,
    bounds: SortedBox,
    transferred: Vec<Transferred>,
}

impl TransferredGrips {
    /// Largest memory use in bytes, without the shared boxes.
    pub const MAX_BYTES: usize = MAX_GRIPS * size_of::<Transferred>();

    /// Transfers grips of up to 256 boxes to an object: some milliseconds of work.
    pub fn of(object: &GraspObject, known: &Arc<[HeldPrimitive]>) -> Self {
        unstopped(|stop| Self::of_until(object, known, stop))
    }

    /// As [`Self::of`], unless it is stopped.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of_until(
        object: &GraspObject,
        known: &Arc<[HeldPrimitive]>,
        stop: Stop<'_>,
    ) -> Result<Self, Stopped> {
        let bounds = SortedBox::of(&object.bounding_box);
        let mut by_similarity: Vec<(usize, &HeldPrimitive)> = known.iter().enumerate().collect();
        by_similarity.sort_by(|(_, a), (_, b)| bounds.dissimilarity(a).total_cmp(&bounds.dissimilarity(b)));
        let mut fitting: Vec<(f32, Transferred)> = Vec::new();
        // On a crowded surface no transferred grip holds, and finding that out takes seconds.
        let boxes = if object.surface.is_crowded() {
            0
        } else {
            NEAREST_BOXES
        };
        for (primitive, held) in by_similarity.into_iter().take(boxes) {
            for turn in 0..TURNS.len() {
                for (grip, entry) in held.grips.entries().iter().enumerate() {
                    stop.check_every(MOVES_PER_CHECK, grip)?;
                    let transferred = Transferred {
                        primitive: primitive as u8,
                        turn: turn as u8,
                        grip: grip as u16,
                        passes_screen: false,
                    };
                    let object_from_primitive = bounds.place(held, transferred);
                    if let Some(offset) = contact_offset(&entry.contacts, object, object_from_primitive) {
                        fitting.push((offset, transferred));
                    }
                }
            }
        }
        fitting.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        fitting.truncate(MAX_GRIPS);
        let mut screen = ClosureScreen {
            scene: ObjectScene::new(object, object.friction_under(Validity::Physical)),
            on_surface: Vec::new(),
            soft_contacts: Vec::new(),
            buffers: Buffers::default(),
        };
        let screened = |(_, transferred): (f32, Transferred)| {
            let held = &known[usize::from(transferred.primitive)];
            Transferred {
                passes_screen: screen.passes(transferred.contacts(held), bounds.place(held, transferred)),
                ..transferred
            }
        };
        stop.check()?;
        Ok(Self {
            known: Arc::clone(known),
            bounds,
            transferred: fitting.into_iter().map(screened).collect(),
        })
    }

    /// The number of grips.
    pub fn len(&self) -> usize {
        self.transferred.len()
    }

    /// True if no grip fits.
    pub fn is_empty(&self) -> bool {
        self.transferred.is_empty()
    }

    /// The number of grips that pass the closure screen.
    pub fn passing(&self) -> usize {
        self.transferred
            .iter()
            .filter(|transferred| transferred.passes_screen)
            .count()
    }

    /// The grips that meet the requirements and are farthest from the barriers, on the object; the best fitting ones win ties. Only
    /// those that pass the closure screen if `only_passing`, and if any does. They were made for the hand of `around`.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn away_from(
        &self,
        only_passing: bool,
        around: &GraspContext<'_>,
        stop: Stop<'_>,
    ) -> Result<Grips, Stopped> {
        // An object unlike all boxes may have no passing grip and still be held by one that fits.
        let only_passing = only_passing && self.passing() > 0;
        let candidates = self.transferred.iter().copied();
        let held = |transferred: Transferred| &self.known[usize::from(transferred.primitive)];
        let clearance = |transferred, barriers: Barriers<'_>| {
            let held = held(transferred);
            let place = self.bounds.place(held, transferred);
            let grips = &held.grips;
            grips.clearance_upper_bound(usize::from(transferred.grip), Some(place), barriers)
        };
        let moved = |transferred| {
            let held = held(transferred);
            held.grips.entries()[usize::from(transferred.grip)].moved(self.bounds.place(held, transferred))
        };
        let candidates = candidates.filter(|transferred| !only_passing || transferred.passes_screen);
        Grips::farthest(candidates, clearance, moved, around, stop)
    }
}

/// An object's bounding box with its longest edges first, as in primitives.
#[derive(Clone, Copy, Debug)]
struct SortedBox {
    object_from_box: Pose,
    half_extents: Vec3,
}

impl SortedBox {
    fn of(bounds: &OrientedBox) -> Self {
        let mut axes = [0, 1, 2].map(|axis| (bounds.half_extents[axis], Vec3::AXES[axis]));
        axes.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let [x, y, _] = axes.map(|(_, axis)| axis);
        let turn = Quat::from_mat3(&Mat3::from_cols(x, y, x.cross(y))).normalize();
        Self {
            object_from_box: bounds.object_from_box * Pose::new(Vec3::ZERO, turn),
            half_extents: Vec3::from(axes.map(|(half, _)| half.max(MIN_SIZE))),
        }
    }

    fn dissimilarity(&self, other: &HeldPrimitive) -> f32 {
        let ratios = self.half_extents / other.primitive.half_extents;
        ratios.to_array().map(|ratio| ratio.ln().powi(2)).iter().sum()
    }

    /// The frame of a primitive on the object for one of its grips: the centroid of the contacts keeps its place relative to the
    /// box.
    fn place(&self, held: &HeldPrimitive, transferred: Transferred) -> Pose {
        let contacts = transferred.contacts(held);
        let middle = middle(contacts.iter());
        let scaled = middle * self.half_extents / held.primitive.half_extents;
        let turn = TURNS[usize::from(transferred.turn)];
        self.object_from_box * Pose::new(turn * (scaled - middle), turn)
    }
}

/// The larger of the distances of the thumb and of the nearest finger from the object's surface; `None` if it exceeds
/// [`MAX_CONTACT_OFFSET`].
fn contact_offset(contacts: &[Contact], object: &GraspObject, object_from_primitive: Pose) -> Option<f32> {
    let nearest = |is_thumb: bool| {
        let of_part = contacts
            .iter()
            .filter(|contact| contact.part.is_thumb() == Some(is_thumb));
        let distances = of_part.filter_map(|contact| {
            let position = object_from_primitive.transform_point(contact.position);
            let surface = &object.surface;
            let closest = surface.closest_point_within(position, MAX_CONTACT_OFFSET)?;
            let facing = object_from_primitive.transform_vector(contact.normal);
            let is_outside = surface.mesh().normal(closest.triangle as usize).dot(facing) >= FACING_COS;
            (is_outside || surface.is_sheet(closest.triangle)).then_some(closest.distance)
        });
        distances.min_by(f32::total_cmp)
    };
    Some(nearest(true)?.max(nearest(false)?))
}

/// A cheap test of whether a transferred grip can hold an object, from where its contacts land and before the hand is closed.
#[derive(Debug)]
struct ClosureScreen<'a> {
    scene: ObjectScene<'a>,
    on_surface: Vec<Contact>,
    soft_contacts: Vec<SoftContact>,
    buffers: Buffers,
}

impl ClosureScreen<'_> {
    /// True if no contact is near a forbidden surface, and an upper bound of the closure of those that land on the surface and
    /// face it is sufficient.
    fn passes(&mut self, contacts: &[Contact], object_from_primitive: Pose) -> bool {
        let object = self.scene.object;
        self.on_surface.clear();
        for contact in contacts {
            let position = object_from_primitive.transform_point(contact.position);
            let forbidden = object.forbidden_surface();
            if forbidden.is_some_and(|surface| {
                surface
                    .closest_point_within(position, FORBIDDEN_CLEARANCE)
                    .is_some()
            }) {
                return false;
            }
            let Some(closest) = object.surface.closest_point_within(position, SNAP_DISTANCE) else {
                continue;
            };
            // At an edge, a contact may press along many directions; the grip's own normal decides which.
            let normal = object_from_primitive.transform_vector(contact.normal);
            let triangle_normal = object.surface.mesh().normal(closest.triangle as usize);
            if normal.dot(triangle_normal) > SCREEN_COS {
                self.on_surface.push(Contact {
                    position: closest.position,
                    normal,
                    triangle: closest.triangle,
                    part: contact.part,
                });
            }
        }
        soften(&self.on_surface, self.scene.friction, &mut self.soft_contacts);
        // Closure does not depend on gravity.
        let load = self.scene.load(&self.soft_contacts, Vec3::Y);
        let bound = epsilon_upper_bound(&self.soft_contacts, &load, &mut self.buffers);
        bound > 0.0 && bound >= self.scene.required_epsilon(&load.torque_scale)
    }
}
