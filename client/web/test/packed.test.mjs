import assert from "node:assert/strict";
import { test } from "node:test";
import { decodePacked, rigid, withJoints } from "@grasp/client";
import { assertSamePose, rigs, vectors } from "./golden.mjs";

const HALF_DEGREE = Math.PI / 360;

test("packed grasps decode to the answer's hand, and pose its joints", () => {
  for (const { name, conventions } of vectors) {
    for (const { grasp, request } of conventions) {
      const unit = grasp.hand.joints[0].radius > 0.5 ? 100 : 1;
      const { hand, contacts, type } = decodePacked(grasp.packed);
      assert.deepEqual([hand.rig, hand.handedness, hand.convention], [grasp.hand.rig, grasp.hand.handedness, grasp.hand.convention]);
      assert.equal(type, grasp.type);
      assert.deepEqual(new Set(contacts), new Set(grasp.contacts.map(({ digit }) => digit)));
      assertSamePose(hand.objectFromWrist, grasp.hand.objectFromWrist, 0.0005 * unit, HALF_DEGREE, name);
      for (const digit of ["thumb", "index", "middle", "ring", "little"]) {
        for (const angle of ["baseYaw", "basePitch", "secondPitch", "thirdPitch"]) {
          assert.ok(Math.abs(hand[digit][angle] - grasp.hand[digit][angle]) < HALF_DEGREE, `${name}: ${digit}, ${angle}`);
        }
      }
      const posed = withJoints(hand, rigs.get(hand.rig), rigid(request.holdout.clientFromObject));
      assertSamePose(posed.clientFromWrist, grasp.hand.clientFromWrist, 0.0005 * unit, HALF_DEGREE, name);
      for (const [index, { pose, radius }] of posed.joints.entries()) {
        assertSamePose(pose, grasp.hand.joints[index].pose, 0.0005 * unit, HALF_DEGREE, `${name}, joint ${index}`);
        assert.ok(Math.abs(radius - grasp.hand.joints[index].radius) < 1e-5 * unit);
      }
    }
  }
});

test("exact angles pose the answer's joints", () => {
  for (const { name, conventions } of vectors) {
    for (const { grasp, request } of conventions) {
      const unit = grasp.hand.joints[0].radius > 0.5 ? 100 : 1;
      const posed = withJoints({ ...grasp.hand, joints: [] }, rigs.get(grasp.hand.rig), rigid(request.holdout.clientFromObject));
      for (const [index, { pose }] of posed.joints.entries()) {
        assertSamePose(pose, grasp.hand.joints[index].pose, 1e-5 * unit, 1e-4, `${name}, joint ${index}`);
      }
    }
  }
});

test("other bytes and other rigs are refused", () => {
  const { packed } = vectors[0].conventions[0].grasp;
  assert.throws(() => decodePacked(Uint8Array.of(2, ...packed.slice(1))), RangeError);
  assert.throws(() => decodePacked(packed.slice(0, 30)), RangeError);
  assert.throws(() => decodePacked(new Uint8Array()), RangeError);
  const { hand } = decodePacked(packed);
  assert.throws(() => withJoints({ ...hand, rig: "rigs/other" }, rigs.get("rigs/adult"), rigid(undefined)), RangeError);
});
