//! A client's knowledge of its object: regions and grips, as given and on the mesh.

use std::sync::Arc;

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::{Stop, Stopped},
    geometry::{mesh::TriangleMesh, zone::Zone},
    known::moved_grips::on_resized,
    model::{
        hand::{HandPose, Handedness, rig::Rig},
        object::GraspObject,
        plain_object::{BannedGrip, PlainObject},
        regions::{Region, Regions},
        strategy::Validity,
    },
    physical::{
        grip::{FEWEST_CONTACTS, Gripper, MAX_PENETRATION, Misfit},
        presented::ObjectScene,
    },
};
use prost::Message as _;

use super::{StoredObject, mesh_file::MeshFile};
use crate::{
    convention::Convention,
    error::ServiceError,
    rigs::{RigHand, resource_name},
    validate::{GripFields, GripKind, PreferredGrip, RegionFields, RegionKind, Violations},
};

/// Triangles compared with the shapes of forbidden regions between two checks of the stop.
const TRIANGLES_PER_CHECK: usize = 256;

/// A client's knowledge of its object; empty by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Given {
    /// The centre of mass in metres, in the object's frame. `None` for that of the mesh.
    pub centre_of_mass: Option<Vec3>,
    pub regions: Arc<[RegionFields]>,
    /// Preferred and banned grips.
    pub grips: Arc<[GripFields]>,
}

/// The regions on the triangles of a mesh.
#[derive(Debug)]
pub(super) struct OnMesh {
    /// The triangles that must not be touched, ascending.
    pub forbidden: Vec<u32>,
    /// The preferred and avoided regions.
    pub regions: Regions,
}

impl Given {
    /// A built-in object's forbidden triangles as a region, as the contract has it.
    pub(super) fn of_built_in(object: &PlainObject) -> Self {
        let all = 0..u32::try_from(object.mesh.triangles().len()).expect("built-in meshes are small");
        let triangles: Vec<u32> = all.filter(|&triangle| object.is_forbidden(triangle)).collect();
        let region = (!triangles.is_empty()).then(|| RegionFields {
            given: v1::Region {
                triangles,
                ..v1::Region::new("forbidden", v1::Preference::Forbidden)
            },
            kind: RegionKind::Forbidden,
            zones: Vec::new(),
        });
        Self {
            regions: region.into_iter().collect(),
            ..Self::default()
        }
    }

    /// Locates the regions on a mesh from a file. Adds a violation for each name and index that is not in the file.
    pub(super) fn on_mesh(
        &self,
        mesh: &TriangleMesh,
        file: &MeshFile,
        violations: &Violations,
        stop: Stop<'_>,
    ) -> Result<OnMesh, Stopped> {
        let mut forbidden = Vec::new();
        let mut regions = Vec::new();
        for (place, region) in self.regions.iter().enumerate() {
            let object_field = violations.field("object");
            let field = object_field.child("regions").at(place);
            let v1::Region {
                groups, triangles, ..
            } = &region.given;
            let named = file.named(field, groups, triangles);
            match region.kind {
                RegionKind::Forbidden => {
                    forbidden.extend(named);
                    for triangle in 0..mesh.triangles().len() {
                        stop.check_every(TRIANGLES_PER_CHECK, triangle)?;
                        let corners = mesh.corners(triangle);
                        if region.zones.iter().any(|zone| zone.meets(corners)) {
                            forbidden.push(triangle as u32);
                        }
                    }
                }
                RegionKind::Weighted(wish, weight) => regions.push(Region {
                    wish,
                    weight,
                    triangles: named,
                    zones: region.zones.clone(),
                }),
            }
        }
        forbidden.sort_unstable();
        forbidden.dedup();
        Ok(OnMesh {
            forbidden,
            regions: Regions::new(&regions, mesh.triangles().len()),
        })
    }

    /// The grips that must not be answered.
    pub(super) fn banned(&self) -> Vec<BannedGrip> {
        let banned = self.grips.iter().filter_map(|grip| match grip.kind {
            Some(GripKind::Banned(banned)) => Some(banned),
            _ => None,
        });
        banned.collect()
    }

    /// The grips to try first with a hand, by name.
    pub(crate) fn preferred(&self, hand: &RigHand) -> Vec<(String, HandPose)> {
        let rig = &hand.hand.rig;
        let rig_name = resource_name(rig);
        let hundredths = (100.0 * hand.scale).round() as u16;
        let of_hand = self.grips.iter().filter_map(|grip| match grip.kind {
            Some(GripKind::Preferred(preferred))
                if preferred.handedness == rig.handedness
                    && preferred.hundredths == hundredths
                    && grip.rig() == rig_name =>
            {
                Some((grip.given.name.clone(), preferred.pose(rig)))
            }
            _ => None,
        });
        of_hand.collect()
    }

    /// The rig of each preferred grip whose rig is known, at the size of its hand.
    pub(crate) fn rigs(&self, rig: impl Fn(&str, Handedness) -> Option<Rig>) -> Vec<Option<Rig>> {
        let of_grip = |grip: &GripFields| match grip.kind {
            Some(GripKind::Preferred(preferred)) => {
                let rig = rig(grip.rig(), preferred.handedness)?;
                Some(rig.scaled(f32::from(preferred.hundredths) / 100.0))
            }
            Some(GripKind::Banned(_)) | None => None,
        };
        self.grips.iter().map(of_grip).collect()
    }

    /// The same for the object resized to `scale`. `rigs` are those of its grips; the digits of a hand without a known rig stay.
    pub(super) fn at_scale(
        &self,
        scale: f32,
        [own, resized]: [&GraspObject; 2],
        rigs: &[Option<Rig>],
    ) -> Self {
        let scenes =
            [own, resized].map(|object| ObjectScene::new(object, object.friction_under(Validity::Physical)));
        let moved = |preferred: PreferredGrip, rig: Option<&Rig>| {
            let Some(rig) = rig else {
                return PreferredGrip {
                    object_from_wrist: own.wrist_at(scale, preferred.object_from_wrist),
                    ..preferred
                };
            };
            let hand = on_resized(scenes.each_ref(), scale, rig, &preferred.pose(rig));
            PreferredGrip {
                object_from_wrist: hand.frame_from_wrist,
                digits: hand.digits,
                ..preferred
            }
        };
        let grips = self.grips.iter().zip(rigs).map(|(grip, rig)| GripFields {
            kind: grip.kind.map(|kind| match kind {
                GripKind::Preferred(preferred) if scale != 1.0 => {
                    GripKind::Preferred(moved(preferred, rig.as_ref()))
                }
                // The resized object has its banned grips.
                kind => kind,
            }),
            ..grip.clone()
        });
        Self {
            grips: grips.collect(),
            ..self.clone()
        }
    }

    pub(crate) fn grips_to_wire(&self) -> Vec<v1::KnownGrip> {
        self.grips.iter().map(|grip| grip.given.clone()).collect()
    }

    pub(crate) fn regions_to_wire(&self) -> Vec<v1::Region> {
        self.regions.iter().map(|region| region.given.clone()).collect()
    }

    /// Its estimated size in bytes.
    pub(super) fn bytes(&self) -> usize {
        let of_regions = self.regions.iter().map(|region| {
            let of_zones: usize = region.zones.iter().map(Zone::bytes).sum();
            // Numbers take up to four times as many bytes in memory as in a message.
            size_of_val(region) + 4 * region.given.encoded_len() + of_zones
        });
        let of_grips = self.grips.iter();
        let of_grips = of_grips.map(|grip| size_of_val(grip) + 4 * grip.given.encoded_len());
        of_regions.sum::<usize>() + of_grips.sum::<usize>()
    }
}

/// The conventions in which a wrist may be given.
const CONVENTIONS: [v1::Convention; 6] = [
    v1::Convention::Openxr,
    v1::Convention::Unity,
    v1::Convention::UnityFlipX,
    v1::Convention::Unreal,
    v1::Convention::UnrealXzy,
    v1::Convention::Godot,
];

/// Checks the preferred grips of an object whose rigs `rig` knows.
pub(crate) fn check_grips(
    stored: &StoredObject,
    rig: impl Fn(&str, Handedness) -> Option<Rig>,
    stop: Stop<'_>,
) -> Result<(), ServiceError> {
    let grips = &stored.given.grips;
    let is_preferred = |kind: Option<GripKind>| matches!(kind, Some(GripKind::Preferred(_)));
    if !grips.iter().any(|grip| is_preferred(grip.kind)) {
        return Ok(());
    }
    let object = GraspObject::of_until(stored.object.clone(), stop)?;
    let scene = ObjectScene::new(&object, object.friction_under(Validity::Physical));
    let mut gripper = Gripper::default();
    let violations = Violations::default();
    let rigs = stored.given.rigs(rig);
    for (place, (grip, rig)) in grips.iter().zip(&rigs).enumerate() {
        stop.check()?;
        let (Some(GripKind::Preferred(preferred)), Some(rig)) = (grip.kind, rig) else {
            continue;
        };
        let pose = preferred.pose(rig);
        let Some(misfit) = gripper.misfit(&scene, rig, &pose) else {
            continue;
        };
        let fits = |convention: &v1::Convention| {
            let elsewhere = HandPose {
                frame_from_wrist: grip.wrist_in(Convention::from_wire(*convention)),
                ..pose
            };
            gripper.misfit(&scene, rig, &elsewhere).is_none()
        };
        let object_field = violations.field("object");
        let grip_field = object_field.child("known_grips").at(place);
        let field = grip_field.child("hand");
        let (name, wrong) = (&grip.given.name, in_words(misfit));
        match CONVENTIONS.into_iter().find(fits) {
            Some(convention) => field.child("convention").add(format_args!(
                "of {name:?} does not suit the wrist: the hand {wrong}; in {} it would not",
                convention.as_str_name()
            )),
            None => field.child("object_from_wrist").add(format_args!(
                "of {name:?} cannot be right: the hand {wrong}; give the wrist of an answer for the object at its own size, \
                 and its convention"
            )),
        }
    }
    violations.finish(())
}

/// Why a hand does not fit the object.
fn in_words(misfit: Misfit) -> String {
    let most = 1e3 * MAX_PENETRATION;
    match misfit {
        Misfit::Palm(depth) => format!(
            "has palm or forearm {:.1} mm deep in the object, at most {most} mm is flesh",
            1e3 * depth
        ),
        Misfit::Digits => {
            format!("has digits more than {most} mm deep in the object or itself, however they bend")
        }
        Misfit::Contacts(count) => {
            format!("touches the object with {count} of its parts, a grip takes {FEWEST_CONTACTS}")
        }
    }
}
