// Calls a live server in every way, and prints what came of it: node test/live.mjs URL

import { fromJson, toJson } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { createGraspClient, CurrentGraspStatus, downloadMesh, FindGraspResponseSchema, GraspTracker, HandJointsSchema, handAt, presentingHand, reason, violations } from "@grasp/client";
import { vectors } from "./golden.mjs";

const client = createGraspClient(process.argv[2]);
const HOLDOUT = { object: "objects/remote" };
const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));
const result = {};

// The golden answer, but for its report.
const { request, response } = vectors[0].conventions[1];
const { outcome, grasps } = await client.grasps.findGrasp(request);
const text = (answer) => JSON.stringify(toJson(FindGraspResponseSchema, fromJson(FindGraspResponseSchema, answer)));
const [asked, kept] = [{ outcome, grasps }, { outcome: response.outcome, grasps: response.grasps }].map((answer) =>
  text(toJson(FindGraspResponseSchema, { $typeName: "grasp.v1.FindGraspResponse", ...answer })),
);
result.golden = asked === kept ? "same" : `${asked}\n${kept}`;

try {
  await client.grasps.findGrasp({ requirements: { friction: -1 } });
} catch (error) {
  result.violations = violations(error).map(({ field }) => field);
  result.reason = reason(error);
}
try {
  await createGraspClient("http://127.0.0.1:9").grasps.findGrasp({ holdout: HOLDOUT });
} catch (error) {
  result.unreachable = violations(error).length === 0 && Code[ConnectError.from(error).code];
}

result.scores = [];
for await (const { grasps } of client.grasps.streamGrasps({ holdout: HOLDOUT, search: { budget: { nanos: 300_000_000 }, seed: 7n } })) {
  result.scores.push(...grasps.map(({ score }) => score));
}
const planned = await client.grasps.findGrasp({ holdout: HOLDOUT, output: { keyFrames: true } });
result.keyFrames = planned.grasps[0].keyFrames.length;
result.meshBytes = (await downloadMesh(client, "objects/remote")).length;

result.tracked = await track();
console.log(JSON.stringify(result));

async function track() {
  const tracked = { statuses: [], pushed: 0, answered: 0, errors: [], farthest: 0 };
  let last;
  const tracker = new GraspTracker(client, { holdout: HOLDOUT, output: { changesOnly: true } }, {
    onStatus: (status) => tracked.statuses.push(CurrentGraspStatus[status]),
    onAnswer: (answer) => (last = answer),
    onError: (error) => tracked.errors.push(error.message),
  });
  const answered = async () => {
    for (last = undefined; !last; ) {
      await pause(5);
    }
  };
  const object = (step) => ({ position: { x: 0.002 * step, y: 1, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } });
  for (let step = 0; step < 60; step++) {
    tracker.push({ holdout: { clientFromObject: object(step) } });
    tracked.pushed += 1;
    await pause(4);
    if (last) {
      tracked.answered += 1;
      last = undefined;
      const { hand } = tracker.grasp;
      // The grasp is whole, at the object of its frame.
      const wrist = hand.joints[1].pose.position;
      tracked.farthest = Math.max(tracked.farthest, ...["x", "y", "z"].map((axis) => Math.abs(wrist[axis] - hand.clientFromWrist.position[axis])));
    }
  }
  await answered();
  // After the change of grasp has been shown, the hand is at the object, wherever that is.
  await pause(200);
  const [drawn, expected] = [tracker.handAt(object(500)), handAt(tracker.grasp.hand, object(500))];
  tracked.farthest = Math.max(tracked.farthest, Math.abs(drawn.joints[9].pose.position.x - expected.joints[9].pose.position.x));

  // A giver's hand that was there is lost: it is taken where it was.
  const present = await client.grasps.findGrasp({ holdout: HOLDOUT, receiver: { handedness: 2 } });
  const giver = handAt(present.grasps[0].hand, object(60));
  const joints = { ...fromJson(HandJointsSchema, { handedness: "HANDEDNESS_RIGHT" }), joints: giver.joints };
  tracker.push({ holdout: { clientFromObject: object(60), presentingHand: presentingHand(joints) } });
  await answered();
  const lost = { ...joints, joints: joints.joints.map((joint, index) => (index % 3 === 0 ? { ...joint, pose: undefined, radius: 0 } : joint)) };
  tracker.push({ holdout: { clientFromObject: object(60), presentingHand: presentingHand(lost, true) } });
  await answered();
  tracked.lostHand = CurrentGraspStatus[tracker.status];
  tracked.lostWarnings = last.warnings;

  // A track that ended is begun again, with the grasp that was held.
  await tracker.close();
  return tracked;
}
