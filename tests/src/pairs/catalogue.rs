//! Objects whose parts are known by name: where people hold them, and what cuts.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use grasp_everyday::everyday_objects;
use grasp_import::{Import, ImportedMesh, MeshLimits, read_mesh};
use grasp_synthesis::{
    geometry::mesh::TriangleMesh, model::object::GraspObject, propose::prepared::PreparedObject,
};

/// An object's name, the groups of its mesh that are its handle, and those that cut.
type Entry = (&'static str, &'static [&'static str], &'static [&'static str]);

/// Objects that are alike stand next to each other: those with even and with odd numbers make two halves of equal kind.
const OBJECTS: [Entry; 36] = [
    ("hammer", &["handle"], &[]),
    ("axe", &["handle"], &["head"]),
    ("pan", &["handle"], &[]),
    ("ladle", &["handle"], &[]),
    ("kettle", &["handle"], &[]),
    ("iron", &["handle"], &[]),
    ("drill", &["handle"], &[]),
    ("hair-dryer", &["handle"], &[]),
    ("kitchen-knife", &["handle"], &["blade"]),
    ("table-knife", &["handle"], &["blade"]),
    ("saw", &["handle"], &["blade"]),
    ("scalpel", &[], &["blade_edge"]),
    ("screwdriver", &["handle"], &[]),
    ("hair-brush", &["handle"], &[]),
    ("mug", &["handle"], &[]),
    ("lunch-box", &["handle"], &[]),
    ("toothbrush", &["handle"], &[]),
    ("spatula", &["handle", "shaft"], &[]),
    ("trowel", &["handle"], &[]),
    ("tennis-racket", &["handle"], &[]),
    ("wine-bottle", &[], &[]),
    ("large-bottle", &[], &[]),
    ("small-bottle", &[], &[]),
    ("milk-carton", &[], &[]),
    ("book", &[], &[]),
    ("phone", &[], &[]),
    ("ruler", &[], &[]),
    ("pen", &[], &[]),
    ("rolling-pin", &[], &[]),
    ("torch", &[], &[]),
    ("remote", &[], &[]),
    ("banana", &[], &[]),
    ("can", &[], &[]),
    ("key", &[], &[]),
    ("dumbbell", &[], &[]),
    ("brick", &[], &[]),
];

/// Objects of all kinds, few enough for a test.
const FEW: [&str; 8] = [
    "hammer",
    "pan",
    "kettle",
    "kitchen-knife",
    "large-bottle",
    "ruler",
    "remote",
    "scalpel",
];

/// What a triangle of an object belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// Nothing in particular.
    Plain,
    /// The part that people hold it by.
    Handle,
    /// A part that cuts.
    Blade,
}

/// An object with labelled parts. None of them is forbidden, so that grasps of all of them are valid.
#[derive(Clone, Debug)]
pub struct LabelledObject {
    /// Its name.
    pub name: &'static str,
    /// The object.
    pub object: Arc<GraspObject>,
    /// What searches derive from it.
    pub prepared: Arc<PreparedObject>,
    /// The direction against gravity of the object as it usually lies or stands, in its own frame.
    pub usual_up: Vec3,
    /// One label for each triangle.
    pub labels: Vec<Label>,
}

impl LabelledObject {
    /// An object of a mesh, with the labels that `handles` and `blades` give to its groups.
    ///
    /// # Panics
    /// The object is not sound, or has no such group.
    pub fn new(
        name: &'static str,
        read: ImportedMesh,
        about: &About,
        handles: &[&str],
        blades: &[&str],
    ) -> Self {
        let mut labels = vec![Label::Plain; read.mesh.triangles().len()];
        for (groups, label) in [(handles, Label::Handle), (blades, Label::Blade)] {
            for &group in groups {
                let found = read.groups.iter().find(|(name, _)| name == group);
                let (_, triangles) = found.unwrap_or_else(|| panic!("{name} has no group {group}"));
                for &triangle in triangles {
                    labels[triangle as usize] = label;
                }
            }
        }
        let centre = about.centre_of_mass.unwrap_or_else(|| centroid(&read.mesh));
        let object = GraspObject::new(read.mesh, about.mass, centre, about.friction, &[]);
        let object = Arc::new(object.unwrap_or_else(|errors| panic!("{name}: {errors:?}")));
        Self {
            name,
            prepared: Arc::new(PreparedObject::new(Arc::clone(&object))),
            object,
            usual_up: about.usual_up,
            labels,
        }
    }

    /// The corners of the triangles that belong to a part.
    pub fn triangles_of(&self, part: Label) -> impl Iterator<Item = [Vec3; 3]> {
        let labels = self.labels.iter().enumerate();
        labels
            .filter(move |(_, label)| **label == part)
            .map(|(triangle, _)| self.object.surface.mesh().corners(triangle))
    }

    /// True if some triangle belongs to the part.
    pub fn has(&self, part: Label) -> bool {
        self.labels.contains(&part)
    }
}

/// What is known of an object apart from its mesh.
#[derive(Clone, Copy, Debug)]
pub struct About {
    /// In kilograms.
    pub mass: f32,
    /// In metres; none: that of the mesh's volume.
    pub centre_of_mass: Option<Vec3>,
    /// Coefficient of static friction; none if unknown.
    pub friction: Option<f32>,
    /// The direction against gravity of the object as it usually lies or stands.
    pub usual_up: Vec3,
}

/// The objects of which pairs are made.
pub fn labelled_objects() -> Vec<LabelledObject> {
    OBJECTS.into_iter().map(labelled).collect()
}

/// A few of [`labelled_objects`].
pub fn few_labelled_objects() -> Vec<LabelledObject> {
    FEW.into_iter().filter_map(labelled_object).collect()
}

/// One of [`labelled_objects`] by its name.
pub fn labelled_object(name: &str) -> Option<LabelledObject> {
    let entry = OBJECTS.into_iter().find(|(own, ..)| *own == name);
    entry.map(labelled)
}

fn labelled((name, handles, blades): Entry) -> LabelledObject {
    let limits = MeshLimits {
        bytes: 1 << 24,
        vertices: 1 << 20,
        triangles: 1 << 20,
    };
    let read = |obj: &str| {
        read_mesh(obj.as_bytes(), Import::METRES, limits).expect("the project's meshes are sound")
    };
    if let Some(built_in) = grasp_assets::objects::object(name) {
        let about = About {
            mass: built_in.object.mass,
            centre_of_mass: Some(built_in.object.centre_of_mass),
            friction: built_in.object.friction,
            // They lie flat: +Z points out of a flat side.
            usual_up: Vec3::Z,
        };
        return LabelledObject::new(name, read(built_in.obj), &about, handles, blades);
    }
    let everyday = everyday_objects().into_iter().find(|object| object.name == name);
    let everyday = everyday.unwrap_or_else(|| panic!("there is no {name}"));
    let about = About {
        mass: everyday.mass_kg() as f32,
        centre_of_mass: everyday.centre_of_mass().map(DVec3::as_vec3),
        friction: Some(everyday.surface.friction() as f32),
        usual_up: Vec3::Y,
    };
    LabelledObject::new(name, read(&everyday.obj()), &about, handles, blades)
}

/// The centre of a closed mesh's volume.
fn centroid(mesh: &TriangleMesh) -> Vec3 {
    let (mut volume, mut moment) = (0.0, DVec3::ZERO);
    for triangle in 0..mesh.triangles().len() {
        let [a, b, c] = mesh.corners(triangle).map(Vec3::as_dvec3);
        let part = a.dot(b.cross(c));
        volume += part;
        moment += part * (a + b + c) / 4.0;
    }
    (moment / volume).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_objects_have_their_parts_and_are_among_all() {
        let few = few_labelled_objects();
        let names: Vec<_> = few.iter().map(|object| object.name).collect();
        assert_eq!(names.len(), FEW.len(), "{names:?}");
        let knife = few.iter().find(|object| object.name == "kitchen-knife").unwrap();
        assert!(knife.has(Label::Handle) && knife.has(Label::Blade));
        // A chef's knife is longer in its blade than in its handle, which is on the other side of the middle.
        let reach = |part| {
            let corners = knife.triangles_of(part).flatten();
            corners.fold((f32::MAX, f32::MIN), |(low, high), p| {
                (low.min(p.x), high.max(p.x))
            })
        };
        let (blade, handle) = (reach(Label::Blade), reach(Label::Handle));
        assert!(blade.1 - blade.0 > handle.1 - handle.0, "{blade:?} {handle:?}");
        assert!(!few[0].has(Label::Blade));
    }

    #[test]
    fn centroid_of_a_brick_is_its_middle() {
        let brick = labelled_object("brick").unwrap();
        assert!(brick.object.centre_of_mass.length() < 1e-6);
    }
}
