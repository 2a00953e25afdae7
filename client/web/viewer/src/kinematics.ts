/** Joints of posed hands: forward kinematics of the contract's angles. */
import { Matrix4, Quaternion, Vector3 } from "three";

import { type DigitAngles, Handedness, type HandPose } from "#contract/holdout_pb";
import type { HandRig, RigHand } from "#contract/hand_rig_service_pb";
import { poseOf, wireMatrix, type Pose } from "./poses";

/** Base yaw and base, second and third pitch of a digit, in radians. */
export type Angles = [number, number, number, number];

/** Number of OpenXR joints; the palm is first, the wrist second. */
export const JOINTS = 26;
export const WRIST = 1;
export const FIRST_OF_DIGIT = [2, 6, 11, 16, 21];
export const TIP_OF_DIGIT = [5, 10, 15, 20, 25];
export const DIGIT_NAMES = ["thumb", "index", "middle", "ring", "little"] as const;

export type Side = "left" | "right";

export const sideOf = (hand: Handedness): Side => (hand === Handedness.LEFT ? "left" : "right");
export const handedness = (side: Side): Handedness => (side === "left" ? Handedness.LEFT : Handedness.RIGHT);

/** One hand of a rig. */
export class HandRigSide {
  /** The stretched hand's joints in the wrist's frame; `null` for those of a missing digit. */
  readonly stretched: (Matrix4 | null)[];
  readonly radii: number[];
  readonly limits: ([Angles, Angles] | null)[];

  constructor(
    readonly rig: string,
    readonly side: Side,
    hand: RigHand,
  ) {
    this.stretched = hand.stretchedJoints.map((joint) => (joint.pose ? wireMatrix(joint.pose) : null));
    this.radii = hand.stretchedJoints.map((joint) => joint.radius);
    this.limits = DIGIT_NAMES.map((_, digit) => {
      const found = hand.limits.find((limits) => limits.digit === digit + 1);
      return found?.min && found.max ? [anglesOf(found.min), anglesOf(found.max)] : null;
    });
  }

  /** The angles of the stretched hand: each as close to zero as its limits allow. */
  rest(digit: number): Angles {
    return this.clamped(digit, [0, 0, 0, 0]);
  }

  clamped(digit: number, angles: Angles): Angles {
    const limits = this.limits[digit];
    if (!limits) return angles;
    return angles.map((angle, i) => Math.min(Math.max(angle, limits[0][i]!), limits[1][i]!)) as Angles;
  }

  /** The joints of a hand with these angles, in the frame of `wrist`; `null` for those of missing digits. */
  joints(wrist: Matrix4, scale: number, digits: readonly Angles[]): (Matrix4 | null)[] {
    const local = [...this.stretched];
    for (const [digit, angles] of digits.entries()) this.bend(local, digit, angles);
    return local.map((joint) => {
      if (!joint) return null;
      const scaled = joint.clone();
      scaled.setPosition(new Vector3().setFromMatrixPosition(joint).multiplyScalar(scale));
      return scaled.premultiply(wrist);
    });
  }

  private bend(local: (Matrix4 | null)[], digit: number, angles: Angles): void {
    const first = FIRST_OF_DIGIT[digit]! + (digit > 0 ? 1 : 0);
    const stretched = this.stretched[first];
    if (!stretched) return;
    const rest = this.rest(digit);
    // Yaw turns a finger toward the little one's side and lifts the thumb, which mirrors in the other hand.
    const sign = (this.side === "right") === digit > 0 ? -1 : 1;
    const turn = ([yaw, pitch]: Angles) =>
      new Quaternion()
        .setFromAxisAngle(Y, sign * yaw)
        .multiply(new Quaternion().setFromAxisAngle(X, -pitch));
    let joint = stretched
      .clone()
      .multiply(new Matrix4().makeRotationFromQuaternion(turn(rest).invert()))
      .multiply(new Matrix4().makeRotationFromQuaternion(turn(angles)));
    local[first] = joint;
    for (let i = first + 1; i <= TIP_OF_DIGIT[digit]!; i++) {
      const [parent, own] = [this.stretched[i - 1], this.stretched[i]];
      if (!parent || !own) return;
      const along = new Vector3().setFromMatrixPosition(parent.clone().invert().multiply(own));
      joint = joint.clone().multiply(new Matrix4().makeTranslation(along));
      const pitch = angles[i - first + 1];
      if (pitch !== undefined && i < TIP_OF_DIGIT[digit]!) joint.multiply(new Matrix4().makeRotationX(-pitch));
      local[i] = joint;
    }
  }
}

const X = new Vector3(1, 0, 0);
const Y = new Vector3(0, 1, 0);

export function sidesOf(rig: HandRig): HandRigSide[] {
  return rig.hands.map((hand) => new HandRigSide(rig.name, sideOf(hand.handedness), hand));
}

/** A digit's angles; an absent third pitch is two thirds of the second. */
export function anglesOf(wire: DigitAngles | undefined): Angles {
  if (!wire) return [0, 0, 0, 0];
  return [wire.baseYaw, wire.basePitch, wire.secondPitch, wire.thirdPitch ?? (2 / 3) * wire.secondPitch];
}

export function digitsOf(hand: HandPose): Angles[] {
  return DIGIT_NAMES.map((name) => anglesOf(hand[name]));
}

export function wireDigits(digits: readonly Angles[]) {
  return Object.fromEntries(
    DIGIT_NAMES.map((name, digit) => {
      const [baseYaw, basePitch, secondPitch, thirdPitch] = digits[digit]!;
      return [name, { baseYaw, basePitch, secondPitch, thirdPitch }];
    }),
  );
}

/** The joints of an answered hand in the client's frame. */
export function jointsOf(hand: HandPose): (Matrix4 | null)[] {
  return hand.joints.map((joint) => (joint.pose ? wireMatrix(joint.pose) : null));
}

export function wristOf(hand: HandPose): Pose {
  return poseOf(wireMatrix(hand.clientFromWrist));
}
