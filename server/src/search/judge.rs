//! Verdicts about a client's own grasp, and a valid one near it.

use std::time::{Duration, Instant};

use grasp_proto::v1;
use grasp_synthesis::{
    base::stop::Stop,
    model::hand::kinematics::farthest_joint,
    physical::barriers::Barrier,
    search::{
        current::HandWay,
        prepare,
        scene::Task,
        verdicts::{self, Against, Verdict},
    },
};
use rayon::ThreadPool;

use super::{
    job::{FindJob, PreparedJob},
    progress::Progress,
};
use crate::{
    answer::{ClientFrame, settle_margins, wire_grasp, wire_motion, wire_verdict},
    error::ServiceError,
    executor::{Admission, SearchExecutor},
    validate::GivenGrasp,
};

/// A grasp to judge.
#[derive(Debug)]
pub(crate) struct JudgeJob {
    /// The search whose checks the grasp has to pass, with the hand of the grasp.
    pub find: FindJob,
    /// The grasp.
    pub grasp: GivenGrasp,
    /// Whether to search for a valid grasp near it.
    pub find_nearest: bool,
    /// What was repaired in the grasp.
    pub warnings: Vec<String>,
}

/// The verdicts, and when they were found.
#[derive(Debug)]
pub(crate) struct Judged {
    /// The response to the call.
    pub response: v1::ValidateGraspResponse,
    /// When checks and search ended.
    pub ended: Instant,
    /// How long the checks took.
    pub check_time: Duration,
}

/// Judges a grasp on the executor.
///
/// # Errors
/// [`ServiceError::DeadlineExceeded`], or the giver's mesh is no surface, or the work was stopped or panicked.
pub(crate) async fn judge(
    job: JudgeJob,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Judged, ServiceError> {
    let due = job.find.has_deadline.then(|| job.find.due());
    // Boxed: jobs of some kilobytes would make the futures of all calls large.
    let job = Box::new(job);
    executor
        .run_until(due, admission, move |pool, stop| job.run(pool, stop))
        .await
}

impl JudgeJob {
    /// Judges, on the thread that calls.
    pub(super) fn run(self, pool: &ThreadPool, stop: Stop<'_>) -> Result<Judged, ServiceError> {
        let start = Instant::now();
        let Self {
            find,
            grasp,
            find_nearest,
            mut warnings,
        } = self;
        let prepared = find.prepare()?;
        let frame = prepared.frame();
        warnings.extend(prepared.warnings().cloned());
        let mut hands = prepared.hands();
        let (hand, task, settings) = hands.next().ok_or(ServiceError::Cancelled)?;
        let pose = grasp.at_object(task.rig, frame.client_from_object);
        let mut judgement = verdicts::judge(task, &settings.query, &pose, stop)?;
        let check_time = start.elapsed();
        let nearest = if find_nearest && !judgement.is_valid() {
            // A search is due if nothing known is valid.
            prepared
                .nearest_known(task, settings, &pose)
                .or_else(|| prepared.search(pool, stop, &Progress::default()).outcome.grasp)
        } else {
            None
        };
        stop.check()?;
        let ended = Instant::now();
        let way = nearest
            .as_ref()
            .map(|nearest| HandWay::between(&prepare(task, settings), &pose, &nearest.pose));
        for verdict in &mut judgement.verdicts {
            name_obstacle(verdict, &prepared.query.obstacle_places);
        }
        let verdicts = judgement.verdicts.iter();
        let verdicts: Vec<v1::Verdict> = verdicts.map(|verdict| wire_verdict(verdict, frame)).collect();
        let mut seen = wire_grasp(&judgement.grasp, hand, frame);
        settle_margins(&mut seen, &verdicts);
        Ok(Judged {
            response: v1::ValidateGraspResponse {
                valid: judgement.is_valid(),
                verdicts,
                grasp: Some(seen),
                joint_error: farthest(&grasp, &prepared, frame),
                nearest: nearest.as_ref().map(|nearest| wire_grasp(nearest, hand, frame)),
                nearest_motion: way.map(|way| wire_motion(&way, frame.convention)),
                warnings,
            },
            ended,
            check_time,
        })
    }
}

/// Names an obstacle by its place in the request, which may be made of several.
fn name_obstacle(verdict: &mut Verdict, places: &[usize]) {
    if let Some(Against::Barrier(solid @ Barrier::Obstacle(number))) = verdict.against {
        let sent = Barrier::Obstacle(places[number]);
        verdict.description = verdict.description.replace(&solid.to_string(), &sent.to_string());
        verdict.against = Some(Against::Barrier(sent));
    }
}

/// How far the rig's joints are from tracked ones at most, in the client's unit; `None` for a grasp of a rig.
fn farthest(grasp: &GivenGrasp, prepared: &PreparedJob, frame: ClientFrame) -> Option<f32> {
    let GivenGrasp::Tracked(joints) = grasp else {
        return None;
    };
    let (_, Task { rig, .. }, _) = prepared.hands().next()?;
    let object_from_client = frame.client_from_object.inverse();
    let pose = grasp.at_object(rig, frame.client_from_object);
    let metres = farthest_joint(rig, &pose, &joints.transformed(object_from_client));
    Some(frame.convention.length_from_openxr(metres))
}
