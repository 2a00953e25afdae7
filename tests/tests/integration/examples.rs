//! The examples in the comments of the contract's calls: a server answers each as it says there.

use std::{collections::BTreeMap, fs, path::Path};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use grasp_tests::TestServer;
use http::uri::PathAndQuery;
use prost::bytes::{Buf as _, BufMut as _, Bytes};
use prost_reflect::{
    DescriptorPool, DynamicMessage, MessageDescriptor, MethodDescriptor, prost::Message as _,
};
use serde_json::Value;
use tonic::{
    Status,
    client::Grpc,
    codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder},
    transport::Channel,
};

use crate::fixtures::bounded;

/// Ends strings that match every string with the same beginning.
const ANY: char = '…';

/// Ends strings that are replaced by the content of a file.
const OF_FILE: &str = ", in base64";

/// A call with its messages.
#[derive(Debug, Default)]
struct Example {
    method: String,
    requests: Vec<Value>,
    answers: Vec<Value>,
}

/// The examples of a file, in its order.
fn examples(contract: &str) -> Vec<Example> {
    let mut examples = Vec::new();
    let mut messages: Vec<String> = Vec::new();
    for line in contract.lines().map(str::trim) {
        if let Some(text) = line.strip_prefix("//     ") {
            match messages.last_mut().filter(|_| text.starts_with("  ")) {
                Some(message) => message.push_str(text),
                None => messages.push(text.to_owned()),
            }
        } else if let Some(call) = line.strip_prefix("rpc ") {
            let mut example = Example {
                method: call.split('(').next().unwrap().to_owned(),
                ..Example::default()
            };
            for message in messages.drain(..) {
                let (mark, text) = message.split_at(1);
                let value = serde_json::from_str(text).unwrap_or_else(|error| panic!("{text}: {error}"));
                match mark {
                    ">" => example.requests.push(value),
                    _ => example.answers.push(value),
                }
            }
            examples.push(example);
        }
    }
    examples
}

/// Messages as their bytes.
#[derive(Clone, Copy, Default)]
struct BytesCodec;

impl Codec for BytesCodec {
    type Encode = Bytes;
    type Decode = Bytes;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self
    }

    fn decoder(&mut self) -> Self {
        Self
    }
}

impl Encoder for BytesCodec {
    type Item = Bytes;
    type Error = Status;

    fn encode(&mut self, item: Bytes, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        buffer.put(item);
        Ok(())
    }
}

impl Decoder for BytesCodec {
    type Item = Bytes;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<Bytes>, Status> {
        Ok(Some(buffer.copy_to_bytes(buffer.remaining())))
    }
}

/// Strings of answers by their placeholders.
type Names = BTreeMap<String, String>;

/// A request's JSON with its placeholders filled in.
fn filled(value: Value, names: &Names) -> Value {
    match value {
        Value::String(text) => Value::String(match text.strip_suffix(OF_FILE) {
            Some(file) => {
                let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
                STANDARD.encode(fs::read(file).unwrap())
            }
            None => names.get(&text).cloned().unwrap_or(text),
        }),
        Value::Array(values) => values.into_iter().map(|value| filled(value, names)).collect(),
        Value::Object(fields) => fields
            .into_iter()
            .map(|(name, value)| (name, filled(value, names)))
            .collect(),
        other => other,
    }
}

/// A request with time to search on a busy machine, unless it says how long.
fn patient(mut request: Value) -> Value {
    let is_track = request.get("track").is_some_and(Value::is_object);
    let searched = if is_track {
        &mut request["track"]
    } else {
        &mut request
    };
    if searched.get("holdout").is_some() && searched.get("search").is_none() {
        searched["search"] = serde_json::json!({"budget": "10s"});
    }
    request
}

/// Checks that an answer has all that the example has.
fn check_has(answer: &Value, example: &Value, names: &mut Names) -> Result<(), String> {
    match (answer, example) {
        (Value::Object(answer), Value::Object(example)) => example.iter().try_for_each(|(name, example)| {
            let field = answer.get(name).ok_or_else(|| format!("{name} is absent"))?;
            check_has(field, example, names).map_err(|error| format!("{name}: {error}"))
        }),
        (Value::Array(answer), Value::Array(example)) if answer.len() >= example.len() => answer
            .iter()
            .zip(example)
            .try_for_each(|(answer, example)| check_has(answer, example, names)),
        (Value::String(answer), Value::String(example))
            if example
                .strip_suffix(ANY)
                .is_some_and(|start| answer.starts_with(start)) =>
        {
            names.insert(example.clone(), answer.clone());
            Ok(())
        }
        (Value::Number(answer), Value::Number(example)) if near(answer.as_f64(), example.as_f64()) => Ok(()),
        _ if answer == example => Ok(()),
        _ => Err(format!("is {answer}, not {example}")),
    }
}

/// True for numbers that are the same in single precision.
fn near(a: Option<f64>, b: Option<f64>) -> bool {
    a.zip(b).is_some_and(|(a, b)| (a - b).abs() <= 1e-6 * b.abs())
}

fn encoded(descriptor: MessageDescriptor, value: Value) -> Bytes {
    let message = DynamicMessage::deserialize(descriptor, value).expect("the example is a message");
    message.encode_to_vec().into()
}

fn decoded(descriptor: MessageDescriptor, bytes: Bytes) -> Value {
    let message = DynamicMessage::decode(descriptor, bytes).expect("the answer is a message");
    serde_json::to_value(message).unwrap()
}

/// Calls as the example does, and checks the answers.
async fn check(channel: Channel, method: &MethodDescriptor, example: Example, names: &mut Names) {
    let searches = ["FindGrasp", "TrackHoldout", "CreateTrack", "EvaluateHoldout"].contains(&method.name());
    let requests: Vec<Bytes> = example
        .requests
        .into_iter()
        .map(|request| if searches { patient(request) } else { request })
        .map(|request| encoded(method.input(), filled(request, names)))
        .collect();
    let path = format!("/{}/{}", method.parent_service().full_name(), method.name());
    let mut client = Grpc::new(channel);
    client.ready().await.unwrap();
    // On the wire, every call is a stream in both directions.
    let call = client.streaming(
        tonic::Request::new(tokio_stream::iter(requests)),
        PathAndQuery::try_from(path).unwrap(),
        BytesCodec,
    );
    let mut answers = call
        .await
        .unwrap_or_else(|status| panic!("{}: {status}", method.name()))
        .into_inner();
    for expected in example.answers {
        let answer = answers
            .message()
            .await
            .unwrap_or_else(|status| panic!("{}: {status}", method.name()));
        let answer = answer.unwrap_or_else(|| panic!("{} has fewer answers", method.name()));
        let answer = decoded(method.output(), answer);
        if let Err(error) = check_has(&answer, &expected, names) {
            panic!("{}: {error}", method.name());
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_answer_as_the_contract_says() {
    let server = TestServer::start().await;
    let channel = Channel::from_shared(server.endpoint())
        .unwrap()
        .connect()
        .await
        .unwrap();
    let pool = DescriptorPool::decode(grasp_proto::FILE_DESCRIPTOR_SET).unwrap();
    let mut names = Names::new();
    for (service, file) in [
        ("GraspService", "grasp_service"),
        ("ObjectService", "object_service"),
        ("HandRigService", "hand_rig_service"),
    ] {
        let service = pool.get_service_by_name(&format!("grasp.v1.{service}")).unwrap();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../proto/grasp/v1/{file}.proto"));
        let examples = examples(&fs::read_to_string(path).unwrap());
        assert_eq!(examples.len(), service.methods().len());
        for example in examples {
            let method = service
                .methods()
                .find(|method| method.name() == example.method)
                .unwrap();
            assert!(
                !example.requests.is_empty() && !example.answers.is_empty(),
                "{} has no example",
                method.name()
            );
            bounded(
                &example.method.clone(),
                check(channel.clone(), &method, example, &mut names),
            )
            .await;
        }
    }
}
