/** The shown request as code: curl, grpcurl, Python and Rust. */
import { create, toJson } from "@bufbuild/protobuf";

import { FindGraspRequestSchema } from "#contract/grasp_service_pb";
import type { App } from "./app";

/** The shown request in protobuf's JSON. */
export function requestJson(app: App, prettySpaces = 0): string {
  const json = toJson(FindGraspRequestSchema, create(FindGraspRequestSchema, app.request()));
  return JSON.stringify(json, (_, value: unknown) => (typeof value === "number" ? Number(value.toPrecision(7)) : value), prettySpaces);
}

const quoted = (text: string) => `'${text.replaceAll("'", `'\\''`)}'`;

export function curl(app: App): string {
  return `curl -H 'content-type: application/json' -d ${quoted(requestJson(app))} \\
    ${quoted(`${location.origin}/grasp.v1.GraspService/FindGrasp`)}`;
}

export function grpcurl(app: App): string {
  const secure = location.protocol === "https:" ? "" : "-plaintext ";
  return `grpcurl ${secure}-d ${quoted(requestJson(app))} \\
    ${quoted(location.host)} grasp.v1.GraspService/FindGrasp`;
}

/** With the code that grpcio-tools generates from the contract, in its folder. */
export function python(app: App): string {
  return `import grpc
from google.protobuf import json_format
from grasp.v1 import grasp_service_pb2, grasp_service_pb2_grpc

REQUEST = """
${requestJson(app, 2)}
"""

with grpc.insecure_channel("${location.host}") as channel:
    service = grasp_service_pb2_grpc.GraspServiceStub(channel)
    request = json_format.Parse(REQUEST, grasp_service_pb2.FindGraspRequest())
    answer = service.FindGrasp(request)
    print(answer.grasps[0].hand if answer.grasps else answer.report)
`;
}

/** With the crate grasp-client and its feature "json". */
export function rust(app: App): string {
  return `use grasp_client::{GraspClient, json::from_json, v1::FindGraspRequest};

const REQUEST: &str = r#"
${requestJson(app, 2)}
"#;

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let client = GraspClient::connect("${location.origin}").await?;
    let request: FindGraspRequest = from_json(&serde_json::from_str(REQUEST)?)?;
    let answer = client.find_grasp(&request).await?;
    println!("{:?}: {:?}", answer.outcome(), answer.grasp());
    Ok(())
}
`;
}
