/** Hands that a headset tracks, for requests. */

import { create } from "@bufbuild/protobuf";
import {
  Handedness,
  HandJointsSchema,
  JointPoseSchema,
  PresentingHandSchema,
  type HandJoints,
  type JointPose,
  type PresentingHand,
} from "./gen/grasp/v1/holdout_pb.js";
import { poseMessage } from "./pose.js";

/**
 * The 25 joints of a tracked hand in a reference space, with radii; joints that lost tracking are empty. Absent for an input that is not
 * a hand.
 */
export function trackedJoints(frame: XRFrame, source: XRInputSource, space: XRSpace): HandJoints | undefined {
  if (!source.hand || !frame.getJointPose || source.handedness === "none") {
    return undefined;
  }
  const poses = Array.from(source.hand.values(), (joint) => frame.getJointPose!(joint, space));
  // Some runtimes put all joints of a lost hand into one place.
  const isHand = new Set(poses.flatMap((pose) => pose?.transform.position.x ?? [])).size > 1;
  return create(HandJointsSchema, {
    handedness: source.handedness === "left" ? Handedness.LEFT : Handedness.RIGHT,
    joints: poses.map((pose) => (pose && isHand ? jointMessage(pose) : create(JointPoseSchema))),
  });
}

function jointMessage({ transform: { position, orientation }, radius }: XRJointPose): JointPose {
  // Runtimes that do not measure radii say 0, null or NaN; the server derives them.
  return create(JointPoseSchema, { pose: poseMessage({ position, orientation }), radius: radius || 0 });
}

/**
 * The giver's hand of a request. A hand that lost joints is absent; with `keepLost`, for the frames of a track, it is sent as it is: the
 * server takes it where it was last, at the object.
 */
export function presentingHand(joints: HandJoints | undefined, keepLost = false): PresentingHand | undefined {
  if (!joints || (!keepLost && joints.joints.some(({ pose }) => !pose))) {
    return undefined;
  }
  return create(PresentingHandSchema, { form: { case: "joints", value: joints } });
}
