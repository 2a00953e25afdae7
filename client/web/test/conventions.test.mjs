import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import { Check, Conversion, Convention, convertGrasp, convertHand, GraspSchema, jointsOf } from "@grasp/client";
import { assertNear, assertSamePose, vectors } from "./golden.mjs";

const EXACT = 1e-5;

test("grasps in every convention convert to OpenXR's answer", () => {
  for (const { name, conventions } of vectors) {
    const expected = conventions[0].grasp;
    assert.equal(expected.hand.convention, Convention.OPENXR);
    for (const { grasp } of conventions) {
      const what = `${name} in ${Convention[grasp.hand.convention]}`;
      const converted = convertGrasp(grasp, Convention.OPENXR);
      assertSamePose(converted.hand.clientFromWrist, expected.hand.clientFromWrist, EXACT, 4 * EXACT, what);
      assertSamePose(converted.hand.objectFromWrist, expected.hand.objectFromWrist, EXACT, 4 * EXACT, what);
      assert.equal(converted.hand.joints.length, 26);
      for (const [index, { pose, radius }] of converted.hand.joints.entries()) {
        assertSamePose(pose, expected.hand.joints[index].pose, EXACT, 4 * EXACT, `${what}, joint ${index}`);
        assert.ok(Math.abs(radius - expected.hand.joints[index].radius) < 1e-6, what);
      }
      assert.ok(converted.contacts.length > 1);
      for (const [index, contact] of converted.contacts.entries()) {
        for (const part of ["position", "normal", "force"]) {
          assertNear(contact[part], expected.contacts[index][part], EXACT, `${what}, ${part} of contact ${index}`);
        }
      }
      assert.equal(converted.arm === undefined, expected.arm === undefined);
      for (const part of expected.arm ? ["clientShoulder", "clientElbow"] : []) {
        assertNear(converted.arm[part], expected.arm[part], EXACT, `${what}, arm`);
      }
    }
  }
});

test("margins that are lengths change their unit", () => {
  const margins = [
    { check: Check.PENETRATION, value: 0.001, bound: 0.002, where: { x: 1, y: 2, z: 3 } },
    { check: Check.BALANCE, value: 0.001, bound: 0.02 },
    { check: Check.GIVER_CLEARANCE },
  ];
  const converted = convertGrasp(create(GraspSchema, { hand: { convention: Convention.OPENXR }, margins }), Convention.UNREAL).margins;
  assert.deepEqual(
    converted.map(({ value, bound }) => [value, bound]),
    [
      [0.1, 0.2],
      [0.001, 0.02],
      [undefined, undefined],
    ],
  );
  assertNear(converted[0].where, { x: -300, y: 100, z: 200 }, EXACT, "the place");
});

test("named joints are the same in every convention", () => {
  for (const { conventions } of vectors) {
    const expected = jointsOf(conventions[0].grasp.hand);
    assert.deepEqual([expected.length, expected[0].name, expected[1].name], [26, "palm", "wrist"]);
    for (const { grasp } of conventions) {
      for (const [index, { pose }] of jointsOf(grasp.hand).entries()) {
        assertSamePose(pose, expected[index].pose, EXACT, 4 * EXACT, expected[index].name);
      }
    }
  }
});

test("conversions there and back change nothing, importers' axes included", () => {
  for (const convention of [1, 2, 3, 4, 5, 6]) {
    for (const { conventions } of vectors) {
      const { hand } = conventions[0].grasp;
      const back = convertHand(convertHand(hand, convention), Convention.OPENXR);
      assertSamePose(back.objectFromWrist, hand.objectFromWrist, 1e-6, 1e-5, Convention[convention]);
      assertSamePose(back.joints[7].pose, hand.joints[7].pose, 1e-6, 1e-5, Convention[convention]);
    }
    const conversion = new Conversion(convention);
    const point = { x: 0.1, y: -0.2, z: 0.3 };
    for (const kind of ["point", "direction", "pointAtObject", "directionAtObject"]) {
      assertNear(conversion[`${kind}ToOpenXr`](conversion[`${kind}FromOpenXr`](point)), point, 1e-9, kind);
    }
  }
});

test("an object's point keeps its place in the client's frame, importers' axes included", () => {
  const object = { position: { x: 1, y: 2, z: 3 }, orientation: { x: 0.5, y: 0.5, z: -0.5, w: 0.5 } };
  const [point, moved] = [
    { x: 0.1, y: 0.2, z: 0.3 },
    { x: 1.2, y: 1.7, z: 2.9 },
  ];
  for (const convention of [1, 2, 3, 4, 5, 6]) {
    const conversion = new Conversion(convention);
    const { position, orientation: q } = conversion.objectFromOpenXr(object);
    const p = conversion.pointAtObjectFromOpenXr(point);
    // Rotation by a quaternion, written out as v + 2 u x (u x v + w v).
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const [u, v] = [
      [q.x, q.y, q.z],
      [p.x, p.y, p.z],
    ];
    const t = cross(u, v).map((c, i) => c + q.w * v[i]);
    const [x, y, z] = cross(u, t).map((c, i) => v[i] + 2 * c + [position.x, position.y, position.z][i]);
    assertNear(conversion.pointToOpenXr({ x, y, z }), moved, 1e-6, Convention[convention]);
  }
});
