// Calls of a page, made by the bundles for Node and for browsers alike. What they return is plain data for the test.

import { Code, ConnectError, createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { GraspService } from "#contract/grasp_service_pb.js";
import { Outcome } from "#contract/find_grasp_pb.js";
import { StandingStatus } from "#contract/standing_grasp_pb.js";

const REMOTE = { object: "objects/remote", seed: 7n };

// A grasp, its score, and the wrist's place.
async function findGrasp(client) {
  const answer = await client.findGrasp({ ...REMOTE, budget: { seconds: 5n } });
  return {
    outcome: Outcome[answer.outcome],
    joints: answer.grasp.joints.length,
    score: answer.grasp.score.total,
    attempts: Number(answer.report.attempts),
  };
}

// What is wrong with a request.
async function rejection(client) {
  try {
    await client.findGrasp({ ...REMOTE, friction: -1 });
  } catch (error) {
    const known = ConnectError.from(error);
    return { code: Code[known.code], message: known.rawMessage, details: known.details.map((detail) => detail.type) };
  }
  return null;
}

// How a call ends whose deadline has passed when it arrives. The client would not ask if it knew.
async function expired(client) {
  try {
    await client.findGrasp(REMOTE, { headers: { "grpc-timeout": "1n" } });
  } catch (error) {
    const known = ConnectError.from(error);
    return { code: Code[known.code], details: known.details.map((detail) => detail.type) };
  }
  return null;
}

// Better and better grasps, then a summary.
async function streamGrasps(client) {
  const scores = [];
  let summary = null;
  const holdout = { ...REMOTE, budget: { nanos: 400_000_000 } };
  for await (const { event } of client.streamGrasps({ holdout, mostPerSecond: 1000 })) {
    if (event.case === "grasp") {
      scores.push(event.value.grasp.score.total);
    } else {
      summary = { sent: event.value.sent, outcome: Outcome[event.value.outcome] };
    }
  }
  return { scores, summary };
}

// A stream that the page leaves: how its calls ends.
async function leave(client) {
  const leaving = new AbortController();
  const holdout = { ...REMOTE, budget: { seconds: 9n } };
  try {
    for await (const _ of client.streamGrasps({ holdout }, { signal: leaving.signal })) {
      leaving.abort();
    }
  } catch (error) {
    return Code[ConnectError.from(error).code];
  }
  return null;
}

// A giver who moves the object by 5 mm per frame: the page pushes a frame, waits for its answer, and pushes the next.
async function trackMotion(client) {
  const frames = 20;
  const answers = [];
  const frame = (sequence) => ({
    sequence: BigInt(sequence),
    captureTime: { nanos: sequence * 11_000_000 },
    clientFromObject: { position: { x: 0.005 * sequence, y: 0, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } },
  });
  const track = { name: "" };
  const push = (sequence) => client.pushFrame({ track: track.name, frame: frame(sequence) });
  try {
    for await (const { message } of client.openTrack({ setup: { holdout: REMOTE } })) {
      if (message.case === "track") {
        track.name = message.value;
        await push(1);
        continue;
      }
      const { sequence, standing, clientFromWrist } = message.value;
      const moved = 0.005 * Number(sequence);
      answers.push({
        sequence: Number(sequence),
        status: StandingStatus[standing.status],
        // Where the hand is relative to the object.
        x: clientFromWrist ? clientFromWrist.position.x - moved : null,
      });
      if (answers.length === frames) {
        break;
      }
      await push(Number(sequence) + 1);
    }
  } catch (error) {
    if (ConnectError.from(error).code === Code.Unimplemented) {
      return null;
    }
    throw error;
  }
  return answers;
}

// All calls to a server, and one to a server that does not allow this page.
export async function allCalls(server, forbidding) {
  const client = createClient(GraspService, createGrpcWebTransport({ baseUrl: server }));
  const result = {
    found: await findGrasp(client),
    rejection: await rejection(client),
    expired: await expired(client),
    streamed: await streamGrasps(client),
    left: await leave(client),
    tracked: await trackMotion(client),
  };
  if (forbidding) {
    const refused = createClient(GraspService, createGrpcWebTransport({ baseUrl: forbidding }));
    try {
      await findGrasp(refused);
      result.refused = null;
    } catch (error) {
      result.refused = String(error);
    }
  }
  return result;
}
