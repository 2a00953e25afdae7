//! The light client's own uses of the contested resource.

use std::{
    fmt,
    net::SocketAddr,
    time::{Duration, Instant},
};

use grasp_client::v1::{
    self, grasp_service_client::GraspServiceClient, hand_rig_service_client::HandRigServiceClient,
    object_service_client::ObjectServiceClient,
};
use tonic::{Status, Streaming, transport::Channel};

use super::Resource;
use crate::{
    Failure,
    load::{LIGHT, connect},
    requests::{BOX_OBJ, adult_joints, impossible},
    server::ServerProcess,
};

/// Longest time of a use.
const DEADLINE: Duration = Duration::from_secs(1);

/// The object of its calls.
const REMOTE: &str = "objects/remote";

/// The budget of a stream of grasps.
const BUDGET: Duration = Duration::from_millis(20);

/// A client that uses something now and then.
pub(super) struct Modest {
    server: SocketAddr,
    channel: Channel,
    resource: Resource,
    joints: v1::HandJoints,
}

/// How its uses ended.
#[derive(Debug, Default)]
pub(super) struct Uses {
    done: usize,
    failures: Vec<String>,
}

impl Uses {
    /// The share that succeeded; 1 if there was none.
    pub(super) fn share(&self) -> f64 {
        let all = self.done + self.failures.len();
        if all == 0 {
            1.0
        } else {
            self.done as f64 / all as f64
        }
    }
}

impl fmt::Display for Uses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} own uses", self.done, self.done + self.failures.len())?;
        match self.failures.first() {
            Some(first) => write!(f, "; the first failure: {first}"),
            None => Ok(()),
        }
    }
}

impl Modest {
    /// Connects, and creates the object of [`impossible`].
    pub(super) async fn new(server: &ServerProcess, resource: Resource) -> Result<Self, Failure> {
        let channel = connect(server.address, LIGHT).await?;
        impossible(&channel, BUDGET).await?;
        let joints = adult_joints(&channel).await?;
        Ok(Self {
            server: server.address,
            channel,
            resource,
            joints,
        })
    }

    /// Uses it every so often for some time.
    pub(super) async fn uses(self, every: Duration, length: Duration) -> Uses {
        let start = Instant::now();
        let mut uses = Uses::default();
        let mut ticks = tokio::time::interval(every);
        for number in 0.. {
            if matches!(self.resource, Resource::Searches) || start.elapsed() > length {
                break;
            }
            ticks.tick().await;
            match tokio::time::timeout(DEADLINE, self.use_once(number)).await {
                Ok(Ok(())) => uses.done += 1,
                Ok(Err(failure)) => uses.failures.push(failure.to_string()),
                Err(_) => uses.failures.push("not in time".to_owned()),
            }
        }
        uses
    }

    async fn use_once(&self, number: usize) -> Result<(), Failure> {
        let mut grasps = GraspServiceClient::new(self.channel.clone());
        let mut objects = ObjectServiceClient::new(self.channel.clone());
        match self.resource {
            // Its searches are the light load itself.
            Resource::Searches => {}
            Resource::Streams => {
                let request = v1::FindGraspRequest::new(REMOTE).with_budget(BUDGET);
                let answers = grasps
                    .stream_grasps(v1::StreamGraspsRequest::from(request))
                    .await?;
                read_all(answers.into_inner()).await?;
            }
            Resource::Tracks => {
                let track = grasps.create_track(v1::Track::new(REMOTE)).await?;
                let name = track.into_inner().name;
                let frame = v1::TrackFrame {
                    track: name.clone(),
                    sequence: 1,
                    ..Default::default()
                };
                grasps.push_frame(frame).await?;
                grasps.delete_track(v1::DeleteTrackRequest { name }).await?;
            }
            Resource::Uploads => {
                let created = v1::CreateObjectRequest::new(format!("box-{number}"), BOX_OBJ, 0.1);
                let name = objects.create_object(created).await?.into_inner().name;
                let deleted = v1::DeleteObjectRequest {
                    name,
                    ..Default::default()
                };
                objects.delete_object(deleted).await?;
            }
            Resource::Meshes => {
                let name = REMOTE.to_owned();
                read_all(objects.get_mesh(v1::GetMeshRequest { name }).await?.into_inner()).await?;
            }
            Resource::Watches => {
                let all = v1::WatchObjectsRequest {
                    include_present: true,
                    ..Default::default()
                };
                let mut changes = objects.watch_objects(all).await?.into_inner();
                changes.message().await?.ok_or("there is no message")?;
            }
            Resource::Rigs => {
                let mut rigs = HandRigServiceClient::new(self.channel.clone());
                let created = new_rig(format!("own-{number}"), &self.joints);
                let name = rigs.create_rig(created).await?.into_inner().name;
                rigs.delete_rig(v1::DeleteRigRequest { name }).await?;
            }
            Resource::Connections => {
                let named = v1::GetObjectRequest {
                    name: REMOTE.to_owned(),
                };
                let channel = connect(self.server, LIGHT).await?;
                ObjectServiceClient::new(channel).get_object(named).await?;
            }
        }
        Ok(())
    }
}

/// Reads a stream to its end.
pub(super) async fn read_all<M>(mut messages: Streaming<M>) -> Result<(), Status> {
    while messages.message().await?.is_some() {}
    Ok(())
}

/// A request for a rig with an adult's right hand.
pub(super) fn new_rig(id: String, joints: &v1::HandJoints) -> v1::CreateRigRequest {
    v1::CreateRigRequest {
        rig_id: id,
        joints: vec![joints.clone()],
        handedness: v1::Handedness::Right.into(),
        ..Default::default()
    }
}
