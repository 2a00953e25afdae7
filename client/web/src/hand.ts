/** The joints of posed hands. */

import { clone } from "@bufbuild/protobuf";
import { Convention, HandPoseSchema, type HandJoints, type HandPose } from "./gen/grasp/v1/holdout_pb.js";
import { Conversion } from "./conventions.js";
import { compose, inverse, poseMessage, rigid, type Rigid } from "./pose.js";

/** The names of the 26 joints in OpenXR's order. WebXR has these names too, but for "palm". */
export const JOINT_NAMES = [
  "palm",
  "wrist",
  "thumb-metacarpal",
  "thumb-phalanx-proximal",
  "thumb-phalanx-distal",
  "thumb-tip",
  ...["index", "middle", "ring", "pinky"].flatMap((finger) =>
    ["metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"].map((joint) => `${finger}-finger-${joint}`),
  ),
] as const satisfies readonly string[];

/** OpenXR's index of the wrist. */
export const WRIST = 1;

/** OpenXR's indices of each digit's joints, thumb first, from the palm to the tip. */
export const DIGIT_JOINTS: readonly (readonly number[])[] = [
  [2, 3, 4, 5],
  [6, 7, 8, 9, 10],
  [11, 12, 13, 14, 15],
  [16, 17, 18, 19, 20],
  [21, 22, 23, 24, 25],
];

/** A joint by its name in WebXR or "palm". */
export interface NamedJoint {
  name: string;
  /** In the client's frame, in OpenXR's axes and meters. */
  pose: Rigid;
  /** Distance to the skin, in meters. */
  radius: number;
}

/**
 * The joints of an answer's or a tracked hand in OpenXR's order, axes and meters, whatever its convention. Joints of missing digits, and
 * those that lost tracking, are left out.
 */
export function jointsOf(hand: HandPose | HandJoints): NamedJoint[] {
  const conversion = new Conversion("convention" in hand ? hand.convention : Convention.OPENXR);
  const first = hand.joints.length === JOINT_NAMES.length ? 0 : WRIST;
  return JOINT_NAMES.flatMap((name, index) => {
    const joint = hand.joints[conversion.jointAt(index) - first];
    if (!joint?.pose) {
      return [];
    }
    return { name, pose: conversion.jointToOpenXr(rigid(joint.pose)), radius: joint.radius / conversion.unitsPerMeter };
  });
}

/**
 * A hand of an answer with its object at another place, as a copy: `clientFromObject` is the object's pose in the client's frame, in the
 * hand's convention. So a hand stays at an object that moves between answers.
 */
export function handAt(hand: HandPose, clientFromObject: Rigid): HandPose {
  const wrist = compose(clientFromObject, rigid(hand.objectFromWrist));
  const newFromOld = compose(wrist, inverse(rigid(hand.clientFromWrist)));
  const moved = clone(HandPoseSchema, hand);
  moved.clientFromWrist = poseMessage(wrist);
  for (const joint of moved.joints) {
    joint.pose = joint.pose && poseMessage(compose(newFromOld, rigid(joint.pose)));
  }
  const [root] = moved.model;
  if (root) {
    root.pose = poseMessage(compose(newFromOld, rigid(root.pose)));
  }
  return moved;
}
