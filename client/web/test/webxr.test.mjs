import assert from "node:assert/strict";
import { test } from "node:test";
import { Handedness, jointsOf, presentingHand, trackedJoints } from "@grasp/client";

const SPACE = {};

// An input and a frame, as browsers have them, whose joints are at (index / 100, 1, 0).
function tracked({ lost = [], radius = 0.01, at = (index) => index / 100 } = {}) {
  const hand = new Map(Array.from({ length: 25 }, (_, index) => [`joint ${index}`, index]));
  const frame = {
    getJointPose(index, space) {
      assert.equal(space, SPACE);
      const position = { x: at(index), y: 1, z: 0, w: 1 };
      return lost.includes(index) ? null : { transform: { position, orientation: { x: 0, y: 0, z: 0, w: 1 } }, radius };
    },
  };
  return [frame, { hand, handedness: "left" }, SPACE];
}

test("25 joints with radii become the giver's hand", () => {
  const joints = trackedJoints(...tracked());
  assert.equal(joints.handedness, Handedness.LEFT);
  assert.equal(joints.joints.length, 25);
  assert.deepEqual([joints.joints[24].pose.position.x, joints.joints[24].radius], [0.24, 0.01]);
  assert.deepEqual(presentingHand(joints).form, { case: "joints", value: joints });
});

test("unknown radii are 0", () => {
  for (const radius of [NaN, null, 0]) {
    assert.equal(trackedJoints(...tracked({ radius })).joints[3].radius, 0);
  }
});

test("hands that lost joints are absent, but in tracks", () => {
  const gap = trackedJoints(...tracked({ lost: [0, 7] }));
  assert.deepEqual([gap.joints[0].pose, gap.joints[7].pose], [undefined, undefined]);
  assert.ok(gap.joints[8].pose);
  assert.equal(presentingHand(gap), undefined);
  assert.equal(presentingHand(gap, true).form.value, gap);
  // All in one place.
  const gone = trackedJoints(...tracked({ at: () => 0 }));
  assert.ok(gone.joints.every(({ pose }) => !pose));
  assert.equal(presentingHand(undefined, true), undefined);
});

test("a controller has no joints", () => {
  const [frame, , space] = tracked();
  assert.equal(trackedJoints(frame, { hand: null, handedness: "left" }, space), undefined);
  const [, source] = tracked();
  assert.equal(trackedJoints(frame, { ...source, handedness: "none" }, space), undefined);
});

test("a tracked hand has named joints", () => {
  const joints = jointsOf(trackedJoints(...tracked({ lost: [7] })));
  assert.deepEqual([joints.length, joints[0].name, joints[0].pose.position.x], [24, "wrist", 0]);
  assert.deepEqual([joints.at(-1).name, joints.at(-1).pose.position.x], ["pinky-finger-tip", 0.24]);
  assert.ok(!joints.some(({ name }) => name === "index-finger-phalanx-intermediate"));
});
