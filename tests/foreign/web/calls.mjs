// Calls of a page, made by the bundles for Node and for browsers alike. They return plain data for the test.

import { Code, ConnectError, createClient } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";
import { GraspService } from "#contract/grasp_service_pb.js";
import { CurrentGraspStatus, Outcome } from "#contract/grasp_pb.js";

const HOLDOUT = { object: "objects/remote" };
const SEED = 7n;
const REMOTE = { holdout: HOLDOUT, search: { seed: SEED } };

// The request with a time limit.
function within(budget) {
  return { holdout: HOLDOUT, search: { seed: SEED, budget } };
}

// A grasp, its score, and the wrist's place.
async function findGrasp(client) {
  const answer = await client.findGrasp(within({ seconds: 5n }));
  return {
    outcome: Outcome[answer.outcome],
    joints: answer.grasps[0].hand.joints.length,
    score: answer.grasps[0].score,
    attempts: Number(answer.report.attempts),
  };
}

// The fault of a request.
async function rejection(client) {
  try {
    await client.findGrasp({ ...REMOTE, requirements: { friction: -1 } });
  } catch (error) {
    const known = ConnectError.from(error);
    return { code: Code[known.code], message: known.rawMessage, details: known.details.map((detail) => detail.type) };
  }
  return null;
}

// How a call ends whose deadline, in a header, has passed when it arrives. The client would not ask if it knew.
async function expired(client, deadline) {
  try {
    await client.findGrasp(REMOTE, { headers: deadline });
  } catch (error) {
    const known = ConnectError.from(error);
    return { code: Code[known.code], details: known.details.map((detail) => detail.type) };
  }
  return null;
}

// Better and better grasps, then the outcome.
async function streamGrasps(client) {
  const scores = [];
  let end = Outcome.UNSPECIFIED;
  const sent = { case: "maxRateHz", value: 1000 };
  for await (const { grasps, outcome } of client.streamGrasps({ ...within({ nanos: 400_000_000 }), sent })) {
    scores.push(...grasps.map((grasp) => grasp.score));
    end = outcome;
  }
  return { scores, outcome: Outcome[end] };
}

// A stream that the page leaves: how its call ends.
async function leave(client) {
  const leaving = new AbortController();
  try {
    for await (const _ of client.streamGrasps(within({ seconds: 9n }), { signal: leaving.signal })) {
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
  const { name } = await client.createTrack(REMOTE);
  for (let number = 1; number <= frames; number++) {
    const moved = 0.005 * number;
    const clientFromObject = { position: { x: moved, y: 0, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } };
    const { sequence, current, grasp } = await client.pushFrame({
      track: name,
      sequence: BigInt(number),
      captureTime: { nanos: number * 11_000_000 },
      holdout: { clientFromObject },
    });
    answers.push({
      sequence: Number(sequence),
      status: CurrentGraspStatus[current.status],
      // Where the hand is relative to the object.
      x: grasp ? grasp.hand.clientFromWrist.position.x - moved : null,
    });
  }
  await client.deleteTrack({ name });
  return answers;
}

// All calls over a transport; the header is a deadline that has passed.
export async function callsOver(transport, deadline) {
  const client = createClient(GraspService, transport);
  return {
    found: await findGrasp(client),
    rejection: await rejection(client),
    expired: await expired(client, deadline),
    streamed: await streamGrasps(client),
    left: await leave(client),
    tracked: await trackMotion(client),
  };
}

// All calls to a server, and one to a server that does not allow this page.
export async function allCalls(server, forbidding) {
  const result = await callsOver(createGrpcWebTransport({ baseUrl: server }), { "grpc-timeout": "1n" });
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
