/** Plays the motion to a grasp. */

import { clone } from "@bufbuild/protobuf";
import type { Grasp } from "./gen/grasp/v1/grasp_pb.js";
import { HandPoseSchema, type DigitAngles, type HandPose } from "./gen/grasp/v1/holdout_pb.js";
import { Conversion } from "./conventions.js";
import { DIGIT_JOINTS, WRIST } from "./hand.js";
import { compose, inverse, mix, poseMessage, rigid, slerp, type Rigid } from "./pose.js";

/**
 * The hand at the share `t` of the motion to a grasp: 0 is its first key frame, 1 the grasp; key frames are evenly apart. Between them the
 * wrist goes straight, turns evenly, and joints turn about their parents, so that bones keep their lengths. Without key frames it is
 * the grasp's hand.
 */
export function playKeyFrames(grasp: Grasp, t: number): HandPose | undefined {
  const hands = grasp.keyFrames.flatMap(({ hand }) => hand ?? []);
  const place = Math.min(1, Math.max(0, t)) * (hands.length - 1);
  const from = hands[Math.floor(place)];
  const to = hands[Math.ceil(place)];
  return from && to ? handBetween(from, to, place % 1) : grasp.hand;
}

/** The hand at the share `t` of the way between two hands of one rig, side and convention. */
export function handBetween(from: HandPose, to: HandPose, t: number): HandPose {
  const hand = clone(HandPoseSchema, from);
  hand.clientFromWrist = to.clientFromWrist && poseMessage(between(rigid(from.clientFromWrist), rigid(to.clientFromWrist), t));
  hand.objectFromWrist = to.objectFromWrist && poseMessage(between(rigid(from.objectFromWrist), rigid(to.objectFromWrist), t));
  for (const digit of ["thumb", "index", "middle", "ring", "little"] as const) {
    mixAngles(hand[digit], to[digit], t);
  }
  moveJoints(hand, from, to, t);
  for (const [index, node] of hand.model.entries()) {
    // A node without a position keeps the file's.
    const { pose } = to.model[index] ?? {};
    if (node.pose && pose) {
      const hasPosition = node.pose.position && pose.position;
      node.pose = poseMessage(between(rigid(node.pose), rigid(pose), t));
      node.pose.position = hasPosition && node.pose.position;
    }
  }
  return hand;
}

function between(from: Rigid, to: Rigid, t: number): Rigid {
  return { position: mix(from.position, to.position, t), orientation: slerp(from.orientation, to.orientation, t) };
}

function mixAngles(angles: DigitAngles | undefined, to: DigitAngles | undefined, t: number): void {
  if (!angles || !to) {
    return;
  }
  const third = [angles, to].map(({ thirdPitch, secondPitch }) => thirdPitch ?? (secondPitch * 2) / 3) as [number, number];
  for (const angle of ["baseYaw", "basePitch", "secondPitch"] as const) {
    angles[angle] += (to[angle] - angles[angle]) * t;
  }
  angles.thirdPitch = third[0] + (third[1] - third[0]) * t;
}

/** Sets the joints at the share `t` of the way, each by its pose in the one before it. */
function moveJoints(hand: HandPose, from: HandPose, to: HandPose, t: number): void {
  const conversion = new Conversion(hand.convention);
  const palmAndDigits = [[0], ...DIGIT_JOINTS];
  const wrist = conversion.jointAt(WRIST);
  if (!from.joints[wrist]?.pose || !to.joints[wrist]?.pose) {
    return;
  }
  const at = (joints: HandPose["joints"], index: number) => rigid(joints[index]?.pose);
  const wristAt = between(at(from.joints, wrist), at(to.joints, wrist), t);
  hand.joints[wrist]!.pose = poseMessage(wristAt);
  for (const joints of palmAndDigits) {
    let [parent, parentAt] = [wrist, wristAt];
    for (const joint of joints.map((index) => conversion.jointAt(index))) {
      if (!from.joints[joint]?.pose) {
        continue;
      }
      const [before, after] = [from, to].map((end) => compose(inverse(at(end.joints, parent)), at(end.joints, joint))) as [Rigid, Rigid];
      parentAt = compose(parentAt, between(before, after, t));
      hand.joints[joint]!.pose = poseMessage(parentAt);
      parent = joint;
    }
  }
}
