//! Registers an object from an OBJ file, and asks for a grasp while a tracked hand holds it out.
//!
//! Start a server, then run the example; all arguments are optional:
//!
//! ```sh
//! cargo run --release --package grasp-server
//! cargo run --package grasp-client --example register_object -- http://[::1]:50051 torch.obj tracked_hand.json
//! ```

use std::{error::Error, fs, path::PathBuf, time::Duration};

use grasp_client::{
    ClientError, Code, GraspClient, Handedness, Preference,
    json::from_json,
    v1::{CreateObjectRequest, FindGraspRequest, GraspObject, HandJoints, Region},
};

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/data"));
    let mut arguments = std::env::args().skip(1);
    let url = arguments.next().unwrap_or("http://[::1]:50051".to_owned());
    let mut file = |default| arguments.next().map_or(data.join(default), PathBuf::from);
    let (mesh, hand) = (file("torch.obj"), file("tracked_hand.json"));

    let client = GraspClient::connect(url).await?;
    let object = register(&client, fs::read(mesh)?).await?;
    println!(
        "{}: {} triangles, {:.0} g, friction {:?}",
        object.name,
        object.triangle_count,
        1000.0 * object.mass_kg,
        object.friction
    );
    for warning in &object.warnings {
        println!("warning: {warning}");
    }

    // A game takes these from its headset each frame: 26 joints with radii, in the order of XR_EXT_hand_tracking.
    let giver: HandJoints = from_json(&serde_json::from_str(&fs::read_to_string(hand)?)?)?;
    let request = FindGraspRequest::new(object.name)
        .with_presenting_hand(giver)
        .receiving(Handedness::Right)
        // The first search on a new object may take longer: its atlas is still small.
        .with_budget(Duration::from_secs(5));
    let answer = client.find_grasp(&request).await?;
    match answer.grasp() {
        Some(grasp) => {
            println!(
                "grasp type {:?}, wrist in the object's frame: {:?}",
                grasp.r#type(),
                grasp.object_from_wrist()
            );
            for contact in &grasp.contacts {
                println!("{:?} touches triangle {}", contact.digit(), contact.triangle);
            }
        }
        None => println!("no grasp in {} attempts", answer.attempts()),
    }
    Ok(())
}

/// Creates the object, or gets it if an earlier run did.
async fn register(client: &GraspClient, obj: Vec<u8>) -> Result<GraspObject, ClientError> {
    let mut torch = CreateObjectRequest::new("torch", obj, 0.15);
    let object = torch.object_mut();
    // The file is in centimetres.
    object.meters_per_unit = Some(0.01);
    object.friction = Some(0.5);
    object.regions = vec![Region {
        groups: vec!["lens".to_owned()],
        ..Region::new("lens", Preference::Forbidden)
    }];
    match client.create_object(&torch).await {
        Err(error) if error.code() == Some(Code::AlreadyExists) => client.get_object("objects/torch").await,
        // An error lists everything wrong with the file, with line numbers.
        result => result,
    }
}
