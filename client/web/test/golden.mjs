// The golden grasps of the contract, and how to compare poses.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { fromJson } from "@bufbuild/protobuf";
import { FindGraspRequestSchema, FindGraspResponseSchema, HandRigSchema, rigid } from "@grasp/client";

const golden = JSON.parse(readFileSync(new URL("../../../proto/golden/grasps.json", import.meta.url)));

export const rigs = new Map(Object.entries(golden.rigs).map(([name, rig]) => [name, fromJson(HandRigSchema, rig)]));

// Each with its name, and per convention, OpenXR's first, the request, the grasp and the answer.
export const vectors = golden.vectors.map(({ name, conventions }) => ({
  name,
  conventions: conventions.map(({ request, answer }) => {
    const response = fromJson(FindGraspResponseSchema, answer);
    return { request: fromJson(FindGraspRequestSchema, request), response, grasp: response.grasps[0] };
  }),
}));

export function assertNear(actual, expected, tolerance, what) {
  for (const axis of ["x", "y", "z"]) {
    const [a, b] = [actual?.[axis], expected?.[axis]];
    assert.ok(Math.abs(a - b) <= tolerance, `${what}: ${axis} is ${a}, not ${b}`);
  }
}

// Within a distance, and an angle in radians.
export function assertSamePose(actual, expected, distance, angle, what) {
  const [a, b] = [rigid(actual), rigid(expected)];
  assertNear(a.position, b.position, distance, what);
  const [p, q] = [a.orientation, b.orientation];
  // |p - q| of unit quaternions is twice the sine of a quarter of the angle between them.
  const apart = (sign) => Math.hypot(p.x - sign * q.x, p.y - sign * q.y, p.z - sign * q.z, p.w - sign * q.w);
  const between = 4 * Math.asin(Math.min(1, Math.min(apart(1), apart(-1)) / 2));
  assert.ok(between <= angle, `${what}: turned by ${between} rad`);
}
