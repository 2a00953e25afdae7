//! The requests of the loads.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_assets::{holdouts::holdouts, objects::objects};
use grasp_client::{
    built_in::request_for,
    v1::{
        self, grasp_service_client::GraspServiceClient, hand_rig_service_client::HandRigServiceClient,
        object_service_client::ObjectServiceClient,
    },
};
use grasp_tests::{
    random_holdouts::{Givers, giving_hands, place},
    recorded::object_of,
};
use rand::{SeedableRng as _, seq::SliceRandom as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use tonic::{Status, transport::Channel};

/// Givers placed on each built-in object, which takes a fifth of a second each.
const GIVERS: u64 = 4;

/// Random holdouts of each built-in object.
const RANDOM_HOLDOUTS: usize = 25;

/// The time within which an idle server answers a search that is kept, and how often it is tried: others may have the core meanwhile.
const SOON: Duration = Duration::from_millis(50);
const ROUNDS: usize = 2;

/// The factor by which the cost of equal searches may differ from the median.
const SPREAD: f64 = 1.5;

/// Seed of random holdouts.
const SEED: u64 = 0x5052_4f4d;

/// A closed box of 4 cm by 3 cm by 2 cm, as OBJ text with one group.
pub(crate) const BOX_OBJ: &str = "\
g shell
v -0.02 -0.015 -0.01
v 0.02 -0.015 -0.01
v 0.02 0.015 -0.01
v -0.02 0.015 -0.01
v -0.02 -0.015 0.01
v 0.02 -0.015 0.01
v 0.02 0.015 0.01
v -0.02 0.015 0.01
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
";

/// Requests for grasps, each with its seed, so that a search costs about the same every time.
#[derive(Clone, Debug)]
pub(crate) struct Requests {
    /// Answered from known grips: some tenths of a millisecond each.
    pub(crate) warm: Arc<[v1::FindGraspRequest]>,
    /// The same without known grips, as far as an idle server answers them soon: milliseconds each.
    pub(crate) searching: Arc<[v1::FindGraspRequest]>,
    /// Those of them that cost about the same. With others, a server that divides its time between too many searches would still be
    /// done with cheap ones.
    pub(crate) equal: Arc<[v1::FindGraspRequest]>,
}

impl Requests {
    /// The built-in holdouts and random ones, in random order. Tries the searches on an idle server and leaves those out that take long:
    /// some holdouts have no grasp at all.
    pub(crate) async fn new(idle: &Channel) -> Result<Self, Status> {
        let warm = warm_requests();
        let mut client = GraspServiceClient::new(idle.clone());
        let mut timed = Vec::new();
        for mut request in warm.iter().cloned() {
            request.search_mut().ignore_atlas = true;
            let mut shortest = None;
            for _ in 0..ROUNDS {
                let start = Instant::now();
                let answer = client.find_grasp(request.clone().with_budget(SOON)).await?;
                if answer.get_ref().outcome() == v1::Outcome::Found {
                    shortest = shortest.into_iter().chain([start.elapsed()]).min();
                }
            }
            timed.extend(shortest.map(|time| (time, request)));
        }
        let mut times: Vec<Duration> = timed.iter().map(|&(time, _)| time).collect();
        times.sort();
        let median = times
            .get(times.len() / 2)
            .ok_or_else(|| Status::internal("no search found anything"))?;
        let usual = median.div_f64(SPREAD)..median.mul_f64(SPREAD);
        let equal = timed.iter().filter(|(time, _)| usual.contains(time));
        Ok(Self {
            warm: warm.into(),
            equal: equal.map(|(_, request)| request.clone()).collect(),
            searching: timed.into_iter().map(|(_, request)| request).collect(),
        })
    }
}

fn warm_requests() -> Vec<v1::FindGraspRequest> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut requests: Vec<v1::FindGraspRequest> = holdouts().iter().map(request_for).collect();
    let hands = giving_hands();
    for built_in in objects() {
        let object = object_of(built_in.obj.as_ref(), 0.1);
        let placed: Vec<_> = (0..GIVERS)
            .map(|giver| place(&object, &hands, SEED + giver))
            .collect();
        let givers = Givers::new(&hands, &placed).expect("hands were placed");
        let name = format!("objects/{}", built_in.name);
        requests.extend((0..RANDOM_HOLDOUTS).map(|_| givers.draw(&mut random).request(&name)));
    }
    requests.shuffle(&mut random);
    let numbered = requests.into_iter().zip(1..);
    numbered.map(|(request, seed)| request.with_seed(seed)).collect()
}

/// Creates a box whose whole surface is forbidden; no attempt satisfies the request that is returned.
pub(crate) async fn impossible(channel: &Channel, budget: Duration) -> Result<v1::FindGraspRequest, Status> {
    let mut create = v1::CreateObjectRequest::new("untouchable", BOX_OBJ, 0.1);
    create.object_mut().regions = vec![v1::Region {
        groups: vec!["shell".to_owned()],
        ..v1::Region::new("forbidden", v1::Preference::Forbidden)
    }];
    ObjectServiceClient::new(channel.clone())
        .create_object(create)
        .await?;
    Ok(v1::FindGraspRequest::new("objects/untouchable").with_budget(budget))
}

/// The joints of the built-in adult's right hand, from which rigs can be created.
pub(crate) async fn adult_joints(channel: &Channel) -> Result<v1::HandJoints, Status> {
    let named = v1::GetRigRequest {
        name: "rigs/adult".to_owned(),
    };
    let rig = HandRigServiceClient::new(channel.clone())
        .get_rig(named)
        .await?
        .into_inner();
    let right = rig
        .hands
        .into_iter()
        .find(|hand| hand.handedness() == v1::Handedness::Right);
    let hand = right.ok_or_else(|| Status::internal("the rig has no right hand"))?;
    Ok(v1::HandJoints::new(v1::Handedness::Right, hand.stretched_joints))
}
