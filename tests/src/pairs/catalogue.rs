//! Objects whose parts are known by name: where people hold them, and what cuts.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use grasp_everyday::everyday_objects;
use grasp_import::{Import, ImportedMesh, MeshLimits, read_mesh};
use grasp_synthesis::{model::object::GraspObject, propose::prepared::PreparedObject};

/// The objects of which pairs are made, few enough for a test: their names, the groups of their meshes that are handles, and
/// those that cut.
const OBJECTS: [(&str, &[&str], &[&str]); 8] = [
    ("hammer", &["handle"], &[]),
    ("pan", &["handle"], &[]),
    ("kettle", &["handle"], &[]),
    ("kitchen-knife", &["handle"], &["blade"]),
    ("large-bottle", &[], &[]),
    ("ruler", &[], &[]),
    ("remote", &[], &[]),
    ("scalpel", &[], &["blade_edge"]),
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
        let centre = about.centre_of_mass.or_else(|| read.mesh.volume_centroid());
        let centre = centre.unwrap_or_else(|| panic!("{name} has no volume"));
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
    /// In metres; `None` if it is that of the mesh's volume.
    pub centre_of_mass: Option<Vec3>,
    /// Coefficient of static friction; `None` if unknown.
    pub friction: Option<f32>,
    /// The direction against gravity of the object as it usually lies or stands.
    pub usual_up: Vec3,
}

/// The objects of which pairs are made.
pub fn labelled_objects() -> Vec<LabelledObject> {
    let labelled =
        |(name, handles, blades): (&'static str, &[&str], &[&str])| labelled(name, handles, blades);
    OBJECTS.into_iter().map(labelled).collect()
}

/// One of [`labelled_objects`].
pub fn labelled(name: &'static str, handles: &[&str], blades: &[&str]) -> LabelledObject {
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
