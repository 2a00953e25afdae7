import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import { GraspSchema, handAt, KeyFrameKind, playKeyFrames, poseMessage, rigid, withJoints } from "@grasp/client";
import { assertNear, assertSamePose, rigs, vectors } from "./golden.mjs";

const DIGITS = ["thumb", "index", "middle", "ring", "little"];
const ANGLES = ["baseYaw", "basePitch", "secondPitch", "thirdPitch"];

// The grasp's hand with its angles multiplied and its wrist drawn back.
function opened(hand, rig, clientFromObject, share, back) {
  const digits = DIGITS.map((digit) => [
    digit,
    { ...hand[digit], ...Object.fromEntries(ANGLES.map((angle) => [angle, share * hand[digit][angle]])) },
  ]);
  const { position, orientation } = hand.objectFromWrist;
  const objectFromWrist = poseMessage({ position: { x: position.x, y: position.y + back, z: position.z }, orientation });
  return withJoints({ ...hand, ...Object.fromEntries(digits), objectFromWrist }, rig, clientFromObject);
}

function motions() {
  return vectors.flatMap(({ conventions }) =>
    conventions.map(({ grasp, request }) => {
      const clientFromObject = rigid(request.holdout.clientFromObject);
      const rig = rigs.get(grasp.hand.rig);
      const at = (share, back) => opened(grasp.hand, rig, clientFromObject, share, back);
      const unit = grasp.hand.joints[0].radius > 0.5 ? 100 : 1;
      const keyFrames = [
        { kind: KeyFrameKind.APPROACH, hand: at(0.4, 0.1 * unit) },
        { kind: KeyFrameKind.PRE_GRASP, hand: at(0.4, 0) },
        { kind: KeyFrameKind.CLOSE, hand: at(1, 0) },
      ];
      return { grasp: create(GraspSchema, { hand: grasp.hand, keyFrames }), at, unit };
    }),
  );
}

test("key frames play from the first to the grasp", () => {
  for (const { grasp, unit } of motions()) {
    for (const [t, index] of [
      [-1, 0],
      [0, 0],
      [0.5, 1],
      [1, 2],
      [7, 2],
    ]) {
      const [played, expected] = [playKeyFrames(grasp, t), grasp.keyFrames[index].hand];
      for (const joint of played.joints.keys()) {
        assertSamePose(played.joints[joint].pose, expected.joints[joint].pose, 1e-5 * unit, 1e-4, `joint ${joint} at ${t}`);
      }
    }
  }
});

test("between key frames wrists go straight, and joints are where the angles put them", () => {
  for (const { grasp, at, unit } of motions()) {
    for (const [t, share, back] of [
      [0.25, 0.4, 0.05],
      [0.6, 0.52, 0],
      [0.75, 0.7, 0],
    ]) {
      const [played, expected] = [playKeyFrames(grasp, t), at(share, back * unit)];
      assertSamePose(played.objectFromWrist, expected.objectFromWrist, 1e-5 * unit, 1e-4, `the wrist at ${t}`);
      assertSamePose(played.clientFromWrist, expected.clientFromWrist, 1e-5 * unit, 1e-4, `the wrist at ${t}`);
      for (const digit of DIGITS) {
        for (const angle of ANGLES) {
          assert.ok(Math.abs(played[digit][angle] - expected[digit][angle]) < 1e-5, `${digit} at ${t}`);
        }
      }
      for (const joint of played.joints.keys()) {
        // A base joint turns about one axis in place of two.
        assertNear(played.joints[joint].pose.position, expected.joints[joint].pose.position, 0.001 * unit, `joint ${joint} at ${t}`);
      }
    }
  }
});

test("without key frames the hand is the grasp's", () => {
  const { grasp } = vectors[0].conventions[0];
  assert.equal(playKeyFrames(grasp, 0.3), grasp.hand);
});

test("a hand follows its object", () => {
  const moved = { position: { x: 1, y: 2, z: 3 }, orientation: { x: 0, y: Math.SQRT1_2, z: 0, w: Math.SQRT1_2 } };
  for (const { conventions } of vectors) {
    for (const { grasp, request } of conventions) {
      const unit = grasp.hand.joints[0].radius > 0.5 ? 100 : 1;
      const [there, expected] = [handAt(grasp.hand, moved), withJoints(grasp.hand, rigs.get(grasp.hand.rig), moved)];
      for (const joint of there.joints.keys()) {
        assertSamePose(there.joints[joint].pose, expected.joints[joint].pose, 2e-5 * unit, 1e-4, `joint ${joint}`);
      }
      const back = handAt(there, rigid(request.holdout.clientFromObject));
      assertSamePose(back.clientFromWrist, grasp.hand.clientFromWrist, 2e-5 * unit, 1e-4, "the wrist");
    }
  }
});
