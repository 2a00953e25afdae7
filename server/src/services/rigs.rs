//! `HandRigService`, and rigs made from its checked requests.

use std::{fmt, sync::Arc, time::Duration};

use glam::Vec3;
use grasp_assets::hands::{self, Hand};
use grasp_import::{ImportError, ImportedHand, ImportedRig, MeshLimits, RigSource, read_rig, rig_at_rest};
use grasp_proto::v1::{self, hand_rig_service_server::HandRigService};
use grasp_synthesis::{
    base::{clock::Clock, pose::Pose, rejection::Rejection, stop::Stop},
    known::primitives::Primitive,
    model::{
        hand::{
            Digit, HandPose, Handedness,
            joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, thesis_from_openxr_frame},
            rig::{DigitLimits, Rig},
        },
        holdout::Holdout,
    },
    propose::prepared::{PreparedObject, PreparedRig},
    search::{
        find_grasp,
        scene::{Scene, Task},
        settings::{Run, SearchSettings},
    },
};
use tonic::{Request, Response, Status};

use super::{Handler, Shared, checked_id};
use crate::{
    access::Owner,
    answer::{wire_joint, wire_rejection},
    call::{CallContext, UploadPermit},
    convention::Convention,
    error::ServiceError,
    executor::{run_behind_searches, run_blocking},
    rigs::{
        RigHand, StoredRig, name_of,
        store::{RigStore, saved_request},
    },
    saved::{Records, StoreError, Unreadable},
    validate::{
        Field, RigFields, RigOrigin, Violations, rig_fields, rig_id_of, rig_page_query, rig_page_token,
    },
    wire::{wire_digit, wire_handedness},
};

/// The built-in rig from which others get their axes, limits and, by default, widths.
const REFERENCE: &str = "adult";

/// The fields of a request that a rig is made from.
const MODELS: &str = "models";
const JOINTS: &str = "joints";

/// Least time between attempts to read damaged records.
const RETRY_EVERY: Duration = Duration::from_secs(1);

/// Half of the edges of the boxes for a hand of an adult's size, in metres: a bar, a remote control and a block.
const BOXES: [Vec3; 3] = [
    Vec3::new(0.08, 0.010, 0.010),
    Vec3::new(0.08, 0.022, 0.012),
    Vec3::new(0.06, 0.028, 0.028),
];

/// Attempts at each box. Ordinary hands need some tens; more would delay the refusal of hands that cannot take any.
const ATTEMPTS: u64 = 1500;

#[tonic::async_trait]
impl HandRigService for Handler {
    async fn list_rigs(
        &self,
        request: Request<v1::ListRigsRequest>,
    ) -> Result<Response<v1::ListRigsResponse>, Status> {
        let query = rig_page_query(request.get_ref())?;
        let (rigs, more) = self.rigs.page(query.after.as_deref(), query.size);
        let last = rigs.last().filter(|_| more);
        Ok(Response::new(v1::ListRigsResponse {
            next_page_token: last.map(|(id, _)| rig_page_token(id)).unwrap_or_default(),
            rigs: rigs
                .iter()
                .map(|(id, rig)| {
                    rig.as_ref()
                        .map_or_else(|| damaged_message(id), |rig| rig_message(rig))
                })
                .collect(),
        }))
    }

    async fn get_rig(&self, request: Request<v1::GetRigRequest>) -> Result<Response<v1::HandRig>, Status> {
        let rig = self.rigs.get(&checked_id(&request.get_ref().name, rig_id_of)?)?;
        Ok(Response::new(rig_message(&rig)))
    }

    async fn create_rig(
        &self,
        mut request: Request<v1::CreateRigRequest>,
    ) -> Result<Response<v1::HandRig>, Status> {
        let caller = CallContext::of(&request).caller;
        let permit = UploadPermit::of(&mut request);
        permit.take_turn().await?;
        let (shared, request) = (Arc::clone(&self.0), request.into_inner());
        let built = run_behind_searches(move || {
            let limits = shared.config.mesh_limits(shared.config.maximum_object_bytes);
            let violations = Violations::default();
            let owner = caller.owner();
            let record = shared.rigs.record(&request, &owner);
            let fields = rig_fields(request, limits.bytes, &violations);
            if violations.is_empty() {
                shared.rigs.check_room(&fields.id)?;
                shared.rigs.check_share(&owner)?;
            }
            let mut rig = build_rig(fields, owner, limits, violations)?;
            prepare_rig(&rig);
            try_rig(&mut rig)?;
            Ok::<_, ServiceError>((permit, shared, rig, record))
        });
        let (permit, shared, rig, record) = built.await??;
        let rig = run_blocking(move || {
            let _permit = permit;
            shared.rigs.insert(rig, record)
        })
        .await??;
        Ok(Response::new(rig_message(&rig)))
    }

    async fn delete_rig(&self, request: Request<v1::DeleteRigRequest>) -> Result<Response<()>, Status> {
        let id = checked_id(&request.get_ref().name, rig_id_of)?;
        let caller = CallContext::of(&request).caller;
        let delete = move |shared: &Shared| shared.rigs.delete(&id, &caller);
        Ok(Response::new(self.delete_in_turn(delete).await?))
    }
}

fn rig_message(rig: &StoredRig) -> v1::HandRig {
    v1::HandRig {
        name: rig.name(),
        built_in: rig.built_in,
        owner: rig.owner.to_string(),
        hands: rig
            .hands
            .iter()
            .zip(rig.mirrored)
            .map(|(hand, mirrored)| wire_hand(hand, mirrored))
            .collect(),
        warnings: rig.warnings.clone(),
    }
}

/// A rig of which only the name is known.
fn damaged_message(id: &str) -> v1::HandRig {
    let warning = "its record is damaged or missing; put the file back, or delete the rig";
    v1::HandRig {
        name: name_of(id),
        warnings: vec![warning.to_owned()],
        ..Default::default()
    }
}

fn wire_hand(hand: &RigHand, mirrored: bool) -> v1::RigHand {
    let rig: &Rig = &hand.hand.rig;
    let stretched = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(Pose::IDENTITY),
        digits: rig.stretched(),
    };
    let stretched = HandJoints::of_pose(rig, &stretched);
    let handedness = wire_handedness(rig.handedness).into();
    let joints = hand.binding.iter().flat_map(|binding| binding.joints());
    v1::RigHand {
        handedness,
        stretched_joints: (0..JOINT_COUNT)
            .map(|joint| wire_joint(&stretched, joint, Convention::OpenXr))
            .collect(),
        limits: Digit::ALL
            .into_iter()
            .filter(|&digit| rig.has(digit))
            .map(|digit| wire_limits(digit, &rig.digit(digit).limits))
            .collect(),
        mirrored,
        nodes: joints
            .map(|(node, joint)| v1::RigNode {
                node: node.to_owned(),
                joint: joint.map_or("", |joint| JOINT_NAMES[joint]).to_owned(),
                handedness,
            })
            .collect(),
    }
}

fn wire_limits(digit: Digit, limits: &DigitLimits) -> v1::DigitLimits {
    let ranges = [
        limits.base_yaw,
        limits.base_pitch,
        limits.second_pitch,
        limits.third_pitch,
    ];
    v1::DigitLimits {
        digit: wire_digit(digit).into(),
        min: Some(v1::DigitAngles::new(ranges.map(|range| range.min))),
        max: Some(v1::DigitAngles::new(ranges.map(|range| range.max))),
    }
}

pub(crate) fn build_rig(
    fields: RigFields,
    owner: Owner,
    limits: MeshLimits,
    violations: Violations,
) -> Result<StoredRig, ServiceError> {
    let reference = hands::hand(REFERENCE, Handedness::Right);
    let (Some(source), Some(reference)) = (&fields.source, reference) else {
        return Err(violations.into_error());
    };
    let name = name_of(&fields.id);
    let own_or_reference = |digit: usize| fields.limits[digit].unwrap_or(reference.rig.digits[digit].limits);
    let angles = std::array::from_fn(own_or_reference);
    let about = RigSource {
        name: &name,
        reference: &reference.rig,
        side: fields.side,
        joint_map: &fields.joint_map,
        limits: angles,
        width_scale: fields.width_scale,
        radii: fields.radii,
        is_of_pair: false,
    };
    let [models, joints] = [MODELS, JOINTS].map(|name| violations.field(name));
    let made = match source {
        RigOrigin::Model(bytes, None) => {
            read_rig(bytes, about, limits).map_err(|errors| (models.at(0), errors))
        }
        RigOrigin::Model(bytes, Some(other)) => read_pair(models, [bytes, other], &about, limits),
        RigOrigin::Joints(sent) => rig_at_rest(sent, about).map_err(|errors| (joints, errors)),
    };
    let made = match made {
        Ok(made) => made,
        Err((field, errors)) => {
            for error in errors {
                match error {
                    // Entries of the map are fields of their own.
                    ImportError::At { place, what } if place.starts_with("joint_map[") => {
                        violations.add(place, what);
                    }
                    other => field.add(other),
                }
            }
            return Err(violations.into_error());
        }
    };
    let mirrored = [made.left.is_mirrored, made.right.is_mirrored];
    let mut warnings = fields.warnings;
    warnings.extend(made.warnings);
    let own = [&made.left, &made.right]
        .into_iter()
        .filter(|hand| !hand.is_mirrored);
    warnings.extend(own.filter_map(|hand| missing_fingers(&hand.rig)));
    violations.finish(StoredRig {
        id: fields.id,
        built_in: false,
        owner,
        hands: [made.left, made.right].map(rig_hand),
        mirrored,
        warnings,
    })
}

/// One rig of two models, each of one hand.
fn read_pair<'f>(
    field: Field<'f>,
    [model, other]: [&[u8]; 2],
    about: &RigSource<'_>,
    limits: MeshLimits,
) -> Result<ImportedRig, (Field<'f>, Vec<ImportError>)> {
    let mut source = RigSource {
        is_of_pair: true,
        ..*about
    };
    let [one, two] = [field.at(0), field.at(1)];
    let first = read_rig(model, source, limits).map_err(|errors| (one, errors))?;
    source.side = about.side.map(Handedness::other);
    let other = read_rig(other, source, limits).map_err(|errors| (two, errors))?;
    first.joined(other).map_err(|error| (two, vec![error]))
}

fn side_name(side: Handedness) -> &'static str {
    match side {
        Handedness::Left => "left",
        Handedness::Right => "right",
    }
}

/// A warning that names the fingers that a hand does not have.
fn missing_fingers(rig: &Rig) -> Option<String> {
    let missing: Vec<&str> = Digit::ALL
        .into_iter()
        .filter(|&digit| !rig.has(digit))
        .map(|digit| wire_digit(digit).as_str_name())
        .collect();
    let side = side_name(rig.handedness);
    (!missing.is_empty()).then(|| {
        format!(
            "the {side} hand has no {}; it is posed without",
            missing.join(" and ")
        )
    })
}

/// Lets the hands take a few boxes of their size, and adds a warning for those that cannot take all of them.
fn try_rig(rig: &mut StoredRig) -> Result<(), ServiceError> {
    let violations = Violations::default();
    let is_of_model = rig.hands.iter().any(|hand| hand.binding.is_some());
    let source = if is_of_model { MODELS } else { JOINTS };
    for (hand, mirrored) in rig.hands.iter().zip(rig.mirrored) {
        let own = &hand.hand.rig;
        let reference = hands::hand(REFERENCE, own.handedness);
        let Some(reference) = reference.filter(|_| !mirrored) else {
            continue;
        };
        let (taken, main_rejection) = taken_boxes(own, own.reach / reference.rig.reach);
        let side = side_name(own.handedness);
        if taken == 0 {
            let reason = wire_rejection(main_rejection).as_str_name();
            violations.add(
                source,
                format_args!(
                    "has a {side} hand that takes none of {} boxes of its size in {ATTEMPTS} attempts each, mostly for {reason}; are \
                     the joints right, and the widths? width_scale and radii change them",
                    BOXES.len()
                ),
            );
        } else if taken < BOXES.len() {
            rig.warnings.push(format!(
                "the {side} hand takes only {taken} of {} boxes of its size; searches with it may find little",
                BOXES.len()
            ));
        }
    }
    violations.finish(())
}

/// Prepares the hands for searches, which the first search would otherwise do outside its budget. Takes some tenths of a second.
fn prepare_rig(rig: &StoredRig) {
    for hand in &rig.hands {
        hand.hand.rig.oppositions();
    }
}

/// Makes the saved rigs again, and gives their number. Damaged ones are read again when a call has met one.
pub(crate) async fn load_saved_rigs(rigs: &Arc<RigStore>, limits: MeshLimits) -> Result<usize, StoreError> {
    let Some(saved) = rigs.saved() else {
        return Ok(0);
    };
    let (mut loaded, mut damaged) = (Vec::new(), Vec::new());
    let ids = saved.ids().await?;
    saved.adopt(&ids).await?;
    for id in ids.all {
        if rigs.is_built_in(&id) {
            tracing::warn!(
                rig = name_of(&id),
                "a saved rig is hidden by the built-in one of the same name"
            );
            continue;
        }
        match saved_rig(saved, &id, limits).await? {
            Ok(rig) => {
                rigs.check_room(&id)
                    .map_err(|error| unloadable(saved, &id, &error))?;
                loaded.push(rigs.add_saved(rig, false));
            }
            Err(wrong) => {
                tracing::error!(rig = name_of(&id), %wrong, "what was saved of a rig is damaged");
                rigs.add_damaged(id.clone());
                damaged.push(id);
            }
        }
    }
    let count = loaded.len() + damaged.len();
    tokio::task::spawn_blocking(move || loaded.iter().for_each(|rig| prepare_rig(rig)));
    let rigs = Arc::downgrade(rigs);
    tokio::spawn(async move {
        while !damaged.is_empty() {
            tokio::time::sleep(RETRY_EVERY).await;
            let Some(rigs) = rigs.upgrade() else { return };
            let Some(saved) = rigs.saved() else { return };
            if !rigs.take_damage_met() {
                continue;
            }
            let mut still = Vec::new();
            for id in damaged {
                match saved_rig(saved, &id, limits).await {
                    Ok(Ok(rig)) => {
                        rigs.add_saved(rig, true);
                    }
                    // Until it is deleted.
                    _ if rigs.has_damaged(&id) => still.push(id),
                    _ => {}
                }
            }
            damaged = still;
        }
    });
    Ok(count)
}

async fn saved_rig(
    saved: &Records,
    id: &str,
    limits: MeshLimits,
) -> Result<Result<StoredRig, Unreadable>, StoreError> {
    let read = saved_request(saved, id).await;
    let (request, owner) = match read.map_err(|error| saved.error(&error))? {
        Ok(read) => read,
        Err(Unreadable::Size) => return Err(unloadable(saved, id, &Unreadable::Size)),
        Err(wrong) => return Ok(Err(wrong)),
    };
    let made = run_blocking(move || {
        let violations = Violations::default();
        let fields = rig_fields(request, limits.bytes, &violations);
        build_rig(fields, owner, limits, violations)
    });
    made.await
        .flatten()
        .map(Ok)
        .map_err(|error| unloadable(saved, id, &error))
}

/// The error of a rig that is beyond the limits of this server.
fn unloadable(saved: &Records, id: &str, error: &dyn fmt::Display) -> StoreError {
    let name = name_of(id);
    saved.error(&format_args!(
        "{name} was saved, but this server cannot load it: {error}; raise its limits"
    ))
}

/// The hand of a rig. Its skin, used only for a giver under THESIS validity, is the reference's, stretched.
fn rig_hand(made: ImportedHand) -> RigHand {
    let reference = hands::hand(REFERENCE, made.rig.handedness).expect("the rig is built in");
    RigHand {
        hand: Arc::new(Hand {
            rig: PreparedRig::new(made.rig),
            skin: Arc::clone(&reference.skin),
        }),
        binding: made.binding.map(Arc::new),
        scale: 1.0,
    }
}

/// A clock for searches that attempts end.
struct NoClock;

impl Clock for NoClock {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

/// Lets a hand that is `size` times as large as an adult's take the boxes, each by the same attempts on the calling thread. Returns
/// how many it takes, and why most attempts failed.
fn taken_boxes(rig: &PreparedRig, size: f32) -> (usize, Rejection) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.expect("a thread can be started");
    let settings = SearchSettings {
        run: Run {
            max_attempts: ATTEMPTS,
            reproducible: true,
            ..Run::default()
        },
        ..SearchSettings::default()
    };
    let mut taken = 0;
    let mut rejections = [0; Rejection::ALL.len()];
    for half_extents in BOXES {
        let primitive = Primitive {
            half_extents: size * half_extents,
        };
        let object = Arc::new(primitive.object());
        let prepared = PreparedObject::new(Arc::clone(&object));
        let holdout = Holdout::new(object, None, Vec3::Y).expect("up is a unit vector");
        let task = Task {
            holdout: &holdout,
            object: &prepared,
            rig,
        };
        let outcome = find_grasp(
            &pool,
            &Scene::new(task, &settings),
            &settings,
            &NoClock,
            Stop::NEVER,
        );
        taken += usize::from(outcome.grasp.is_some());
        for (sum, count) in rejections.iter_mut().zip(outcome.report.rejections) {
            *sum += count;
        }
    }
    let by_count = |rejection: &Rejection| rejections[rejection.index()];
    let most = Rejection::ALL.into_iter().max_by_key(by_count);
    (taken, most.unwrap_or(Rejection::NoContacts))
}
