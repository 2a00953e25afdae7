import assert from "node:assert/strict";
import { test } from "node:test";
import { bendArm } from "@grasp/client";
import { assertNear } from "./golden.mjs";

const SHOULDER = { x: 0.2, y: 1.4, z: -0.1 };
const distance = (a, b) => Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z);

test("an arm with a right angle at the elbow has the closed form", () => {
  // 3, 4, 5: the elbow is 1.8 along the way, and 2.4 off it.
  const target = { x: SHOULDER.x + 0.5, y: SHOULDER.y, z: SHOULDER.z };
  const { elbow, wrist } = bendArm(SHOULDER, target, { x: 0.2, y: 0, z: -0.1 }, 0.3, 0.4);
  assertNear(elbow, { x: SHOULDER.x + 0.18, y: SHOULDER.y - 0.24, z: SHOULDER.z }, 1e-12, "the elbow");
  assertNear(wrist, target, 1e-12, "the wrist");
});

test("an elbow keeps the lengths and is on the pole's side", () => {
  for (let step = 0; step < 200; step++) {
    const part = (factor) => Math.sin(factor * step + factor);
    const target = { x: SHOULDER.x + 0.3 * part(1.7), y: SHOULDER.y + 0.3 * part(0.9), z: SHOULDER.z + 0.2 + 0.1 * part(2.3) };
    const pole = { x: part(3.1), y: part(0.3), z: part(1.1) };
    const { elbow, wrist } = bendArm(SHOULDER, target, pole, 0.3, 0.26);
    const reach = Math.min(0.56, Math.max(0.04, distance(target, SHOULDER)));
    assert.ok(Math.abs(distance(elbow, SHOULDER) - 0.3) < 1e-9);
    assert.ok(Math.abs(distance(elbow, wrist) - 0.26) < 1e-9);
    assert.ok(Math.abs(distance(wrist, target) - Math.abs(distance(target, SHOULDER) - reach)) < 1e-9);
    // No other point of the circle on which the elbow can be is nearer to the pole: turn it a little either way.
    const axis = ["x", "y", "z"].map((c) => (wrist[c] - SHOULDER[c]) / distance(wrist, SHOULDER));
    const arm = ["x", "y", "z"].map((c) => elbow[c] - SHOULDER[c]);
    const across = [axis[1] * arm[2] - axis[2] * arm[1], axis[2] * arm[0] - axis[0] * arm[2], axis[0] * arm[1] - axis[1] * arm[0]];
    for (const sign of [0.05, -0.05]) {
      const turned = Object.fromEntries(["x", "y", "z"].map((c, i) => [c, elbow[c] + sign * across[i]]));
      assert.ok(distance(turned, pole) > distance(elbow, pole) - 1e-9);
    }
  }
});

test("an arm that cannot reach is straight, and one without a side bends somewhere", () => {
  const far = { x: SHOULDER.x, y: SHOULDER.y, z: SHOULDER.z + 9 };
  const straight = bendArm(SHOULDER, far, { x: 0, y: 0, z: 0 }, 0.3, 0.26);
  assertNear(straight.wrist, { ...SHOULDER, z: SHOULDER.z + 0.56 }, 1e-9, "the wrist");
  assertNear(straight.elbow, { ...SHOULDER, z: SHOULDER.z + 0.3 }, 1e-9, "the elbow");
  for (const pole of [SHOULDER, far]) {
    const { elbow, wrist } = bendArm(SHOULDER, { ...SHOULDER, z: SHOULDER.z + 0.4 }, pole, 0.3, 0.26);
    assert.ok(Math.abs(distance(elbow, SHOULDER) - 0.3) < 1e-9 && Math.abs(distance(elbow, wrist) - 0.26) < 1e-9);
  }
  const folded = bendArm(SHOULDER, SHOULDER, far, 0.3, 0.3);
  assert.ok(Math.abs(distance(folded.elbow, SHOULDER) - 0.3) < 1e-9);
});
