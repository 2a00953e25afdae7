//! A game loop that asks for a grasp in every frame while the giver moves, and never waits for the server.
//!
//! At most one request is on its way. Each has a deadline of one frame, and hands the last grasp in as the current one: the
//! answer keeps it while it is valid, and is otherwise a near one. Until an answer arrives the character keeps the last grasp:
//! it is known in the object's frame, so it follows the object.
//!
//! Start a server, then run the example; both arguments are optional:
//!
//! ```sh
//! cargo run --release --package grasp-server
//! cargo run --package grasp-client --example every_frame -- http://[::1]:50051 300
//! ```

use std::time::{Duration, Instant};

use glam::{Quat, Vec3};
use grasp_client::{
    ClientError, CurrentGraspStatus, GraspClient, RetryPolicy,
    v1::{CurrentGrasp, FindGraspRequest, FindGraspResponse, HandPose, Pose},
};
use tokio::{task::JoinHandle, time::MissedTickBehavior};

/// One frame at 60 Hz.
const FRAME: Duration = Duration::from_micros(16_667);

/// Time for the search; the rest of the frame is for the way there and back.
const BUDGET: Duration = Duration::from_millis(8);

/// Wait after a failure, unless the server asks for a longer one.
const RETRY_DELAY: Duration = Duration::from_millis(100);

#[tokio::main]
async fn main() -> Result<(), ClientError> {
    let mut arguments = std::env::args().skip(1);
    let url = arguments
        .next()
        .unwrap_or_else(|| "http://[::1]:50051".to_owned());
    let frames: u32 = arguments
        .next()
        .and_then(|count| count.parse().ok())
        .unwrap_or(300);
    let client = GraspClient::builder(url)
        // The budget is added to the call timeout: together, one frame.
        .call_timeout(FRAME.saturating_sub(BUDGET))
        // The next frame asks again anyway, with newer poses.
        .retry(RetryPolicy::NEVER)
        .connect()
        .await?;

    let mut grasping = Grasping::new(client);
    let mut clock = tokio::time::interval(FRAME);
    // After a hitch, go on with the next frame instead of catching up.
    clock.set_missed_tick_behavior(MissedTickBehavior::Skip);
    for frame in 0..frames {
        clock.tick().await;
        let client_from_object = object_pose(FRAME.as_secs_f32() * frame as f32);
        grasping.update(client_from_object).await?;
        if let Some(object_from_wrist) = grasping.grasp.as_ref().and_then(|hand| hand.object_from_wrist)
            && frame % 60 == 0
        {
            // Animate the character's hand toward this pose.
            let wrist = client_from_object * object_from_wrist;
            println!("frame {frame}: wrist at {:.3}", wrist.position());
        }
    }
    println!(
        "{frames} frames: {} new grasps, {} kept, {} without a grasp in time, {} calls failed",
        grasping.found, grasping.kept, grasping.exhausted, grasping.failed
    );
    Ok(())
}

/// The object as the game moves it; a real game also sends the giver's hand.
fn object_pose(seconds: f32) -> Pose {
    let sway = 0.05 * (2.0 * seconds).sin();
    Pose::new(
        Vec3::new(sway, 1.2, -0.4),
        Quat::from_rotation_y(0.5 * seconds.sin()),
    )
}

/// The last grasp, and the request on its way.
struct Grasping {
    client: GraspClient,
    grasp: Option<HandPose>,
    in_flight: Option<JoinHandle<Result<FindGraspResponse, ClientError>>>,
    /// No request is sent before this time.
    resume_at: Instant,
    found: u32,
    kept: u32,
    exhausted: u32,
    failed: u32,
}

impl Grasping {
    fn new(client: GraspClient) -> Self {
        Self {
            client,
            grasp: None,
            in_flight: None,
            resume_at: Instant::now(),
            found: 0,
            kept: 0,
            exhausted: 0,
            failed: 0,
        }
    }

    /// Takes an answer that has arrived, and sends the next request if none is on its way. Does not wait.
    async fn update(&mut self, client_from_object: Pose) -> Result<(), ClientError> {
        if let Some(call) = self.in_flight.take_if(|call| call.is_finished())
            // Fails only if the task panicked, which it does not.
            && let Ok(result) = call.await
        {
            self.receive(result)?;
        }
        if self.in_flight.is_none() && Instant::now() >= self.resume_at {
            let client = self.client.clone();
            let request = FindGraspRequest::new("objects/remote")
                .with_client_from_object(client_from_object)
                .with_budget(BUDGET)
                .with_current(self.grasp.clone().map(CurrentGrasp::new));
            self.in_flight = Some(tokio::spawn(async move { client.find_grasp(&request).await }));
        }
        Ok(())
    }

    fn receive(&mut self, result: Result<FindGraspResponse, ClientError>) -> Result<(), ClientError> {
        match result {
            Ok(answer) => match answer.hand() {
                Some(hand) => {
                    // A new grasp is near the last one: blend the hand to it over a few frames.
                    match answer.status() {
                        CurrentGraspStatus::Kept | CurrentGraspStatus::Adjusted => self.kept += 1,
                        _ => self.found += 1,
                    }
                    self.grasp = Some(hand.clone());
                }
                // The budget is exhausted: keep the last grasp and ask again in the next frame.
                None => self.exhausted += 1,
            },
            // Too late: ask again in the next frame.
            Err(ClientError::DeadlineExceeded(_)) => self.failed += 1,
            // Busy or restarting: leave the server alone for a while.
            Err(ClientError::ResourceExhausted(call) | ClientError::Unavailable(call)) => {
                self.failed += 1;
                let delay = call.details.retry_delay.unwrap_or_default().max(RETRY_DELAY);
                self.resume_at = Instant::now() + delay;
            }
            // Anything else is a mistake in the request, and would fail in every frame.
            Err(error) => return Err(error),
        }
        Ok(())
    }
}
