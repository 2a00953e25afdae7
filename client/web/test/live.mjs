// Calls a live server in every way, and prints what came of it: node test/live.mjs URL

import { create } from "@bufbuild/protobuf";
import {
  createGraspClient,
  CurrentGraspStatus,
  downloadMesh,
  GraspTracker,
  handAt,
  Handedness,
  HandJointsSchema,
  presentingHand,
  reason,
  violations,
} from "@grasp/client";
import { assertSamePose, vectors } from "./golden.mjs";

const client = createGraspClient(process.argv[2]);
const HOLDOUT = { object: "objects/remote" };
const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));
const result = {};

// The golden answer: its figures to the last digit that is written.
const { request, grasp: golden } = vectors[0].conventions[1];
const [found] = (await client.grasps.findGrasp(request)).grasps;
assertSamePose(found.hand.objectFromWrist, golden.hand.objectFromWrist, 1e-6, 1e-5, "the wrist");
for (const [index, { pose }] of found.hand.joints.entries()) {
  assertSamePose(pose, golden.hand.joints[index].pose, 1e-6, 1e-5, `joint ${index}`);
}
result.golden = found.contacts.length === golden.contacts.length && Buffer.compare(found.packed, golden.packed) === 0;

try {
  await client.grasps.findGrasp({ requirements: { friction: -1 } });
} catch (error) {
  result.violations = violations(error).map(({ field }) => field);
  result.reason = reason(error);
}
try {
  await createGraspClient("http://127.0.0.1:9").grasps.findGrasp({ holdout: HOLDOUT });
} catch (error) {
  result.unreachable = [violations(error), reason(error) ?? null];
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
  const names = [];
  const createTrack = async (request) => {
    const track = await client.grasps.createTrack(request);
    names.push(track.name);
    return track;
  };
  const tracker = new GraspTracker(
    { ...client, grasps: { ...client.grasps, createTrack } },
    { holdout: HOLDOUT, search: { budget: { seconds: 1n } }, output: { changesOnly: true } },
    {
      onStatus: (status) => tracked.statuses.push(CurrentGraspStatus[status]),
      onAnswer: (answer) => (last = answer),
      onError: (error) => tracked.errors.push(error.message),
    },
  );
  const answered = async () => {
    for (last = undefined; !last;) {
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
      tracked.farthest = Math.max(
        tracked.farthest,
        ...["x", "y", "z"].map((axis) => Math.abs(wrist[axis] - hand.clientFromWrist.position[axis])),
      );
    }
  }
  // The last frame may be answered by now.
  tracker.push({ holdout: { clientFromObject: object(59) } });
  await answered();
  // After the change of grasp has been shown, the hand is at the object, wherever that is.
  await pause(200);
  const [drawn, expected] = [tracker.handAt(object(500)), handAt(tracker.grasp.hand, object(500))];
  tracked.farthest = Math.max(tracked.farthest, Math.abs(drawn.joints[9].pose.position.x - expected.joints[9].pose.position.x));

  // A giver's hand that was there is lost: it is taken where it was.
  const present = await client.grasps.findGrasp({ holdout: HOLDOUT, receiver: { handedness: Handedness.RIGHT } });
  const giver = handAt(present.grasps[0].hand, object(60));
  const joints = create(HandJointsSchema, { handedness: Handedness.RIGHT, joints: giver.joints });
  tracker.push({ holdout: { clientFromObject: object(60), presentingHand: presentingHand(joints) } });
  await answered();
  const lost = {
    ...joints,
    joints: joints.joints.map((joint, index) => (index % 3 === 0 ? { ...joint, pose: undefined, radius: 0 } : joint)),
  };
  tracker.push({ holdout: { clientFromObject: object(60), presentingHand: presentingHand(lost, true) } });
  await answered();
  tracked.lostHand = CurrentGraspStatus[tracker.status];
  tracked.lostWarnings = last.warnings.length;

  // A track that the server ended is begun again, with the grasp that was held.
  await client.grasps.deleteTrack({ name: names[0] });
  tracker.push({ holdout: { clientFromObject: object(60) } });
  await answered();
  tracked.afterDeletion = CurrentGraspStatus[tracker.status];
  tracked.tracks = names.length;
  await tracker.close();
  try {
    await client.grasps.deleteTrack({ name: names[1] });
  } catch (error) {
    tracked.closed = reason(error);
  }
  return tracked;
}
