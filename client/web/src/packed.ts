/** Packed grasps, which players send to each other, and the joints of their hands. */

import { create } from "@bufbuild/protobuf";
import {
  DigitAnglesSchema,
  Digit,
  Handedness,
  HandPoseSchema,
  JointPoseSchema,
  type DigitAngles,
  type HandPose,
  type JointPose,
} from "./gen/grasp/v1/holdout_pb.js";
import type { GraspType } from "./gen/grasp/v1/grasp_type_pb.js";
import type { DigitLimits, HandRig } from "./gen/grasp/v1/hand_rig_service_pb.js";
import { Conversion } from "./conventions.js";
import { DIGIT_JOINTS, JOINT_NAMES } from "./hand.js";
import { compose, inverse, normalized, poseMessage, rigid, scale, turnAbout, turns, type Rigid } from "./pose.js";

/** A decoded packed grasp. */
export interface PackedGrasp {
  /** The hand in its object's frame, without joints: `withJoints` adds them. */
  hand: HandPose;
  /** The digits that touch the object; `UNSPECIFIED` is the palm. */
  contacts: Digit[];
  /** The grasp type. */
  type: GraspType;
}

const VERSION = 1;
const DIGITS = ["thumb", "index", "middle", "ring", "little"] as const;

/** Decodes `Grasp.packed`. Throws a `RangeError` for bytes that are not a packed grasp of version 1. */
export function decodePacked(packed: Uint8Array): PackedGrasp {
  const data = new DataView(packed.buffer, packed.byteOffset, packed.byteLength);
  if (data.getUint8(0) !== VERSION) {
    throw new RangeError(`a packed grasp of version ${data.getUint8(0)}, not ${VERSION}`);
  }
  const [present, touching] = [data.getUint8(1), data.getUint8(2)];
  const unit = 2 ** data.getInt8(6);
  const int16 = (at: number) => data.getInt16(at, true);
  const idEnd = 22 + data.getUint8(21);
  const hand = create(HandPoseSchema, {
    rig: `rigs/${String.fromCharCode(...packed.subarray(22, idEnd))}`,
    handedness: present & 1 ? Handedness.RIGHT : Handedness.LEFT,
    scale: data.getUint8(5) / 100,
    objectFromWrist: poseMessage({
      position: scale({ x: int16(7), y: int16(9), z: int16(11) }, unit),
      orientation: normalized({ x: int16(13), y: int16(15), z: int16(17), w: int16(19) }),
    }),
    convention: data.getUint8(4),
  });
  let at = idEnd;
  for (const [index, digit] of DIGITS.entries()) {
    if (present & (2 << index)) {
      const [a, b, c, d, e, f] = [0, 1, 2, 3, 4, 5].map((byte) => data.getUint8(at + byte)) as [
        number,
        number,
        number,
        number,
        number,
        number,
      ];
      const values = [a | ((b & 15) << 8), (b >> 4) | (c << 4), d | ((e & 15) << 8), (e >> 4) | (f << 4)];
      const angles = values.map((value) => ((value - 2048) * Math.PI) / 2048) as [number, number, number, number];
      const [baseYaw, basePitch, secondPitch, thirdPitch] = angles;
      hand[digit] = create(DigitAnglesSchema, { baseYaw, basePitch, secondPitch, thirdPitch });
      at += 6;
    }
  }
  const contacts = [Digit.THUMB, Digit.INDEX, Digit.MIDDLE, Digit.RING, Digit.LITTLE, Digit.UNSPECIFIED];
  return { hand, contacts: contacts.filter((_, bit) => touching & (1 << bit)), type: data.getUint8(3) };
}

/**
 * A hand with the joints that its angles give, from its rig (`GetRig`) and its object's pose in the client's frame, in the hand's
 * convention. Throws a `RangeError` if the rig is another one.
 */
export function withJoints(hand: HandPose, rig: HandRig, clientFromObject: Rigid): HandPose {
  const side = rig.hands.find(({ handedness }) => handedness === hand.handedness);
  if (!side || rig.name !== hand.rig) {
    throw new RangeError(`a hand of ${hand.rig} cannot be posed with ${rig.name}`);
  }
  const conversion = new Conversion(hand.convention);
  const wrist = compose(clientFromObject, rigid(hand.objectFromWrist));
  const clientFromWrist = conversion.jointToOpenXr(wrist);
  const size = hand.scale ?? 1;
  const posed = side.stretchedJoints.map(({ pose }) => pose && rigid(pose));
  for (const [index, digit] of DIGITS.entries()) {
    const angles = hand[digit];
    if (angles) {
      poseDigit(
        posed,
        index,
        angles,
        side.limits.find((limits) => limits.digit === index + 1),
        hand.handedness,
      );
    }
  }
  const joints = JOINT_NAMES.map((_, place): JointPose => {
    const index = conversion.jointAt(place);
    const pose = posed[index];
    if (!pose) {
      return create(JointPoseSchema);
    }
    const sized = { ...pose, position: scale(pose.position, size) };
    const radius = (side.stretchedJoints[index]?.radius ?? 0) * size * conversion.unitsPerMeter;
    return create(JointPoseSchema, { pose: poseMessage(conversion.jointFromOpenXr(compose(clientFromWrist, sized))), radius });
  });
  return { ...hand, clientFromWrist: poseMessage(wrist), joints };
}

/** The angle of a stretched joint: the nearest to zero within its limits. */
function stretched(limits: DigitLimits | undefined, angle: "baseYaw" | "basePitch" | "secondPitch" | "thirdPitch"): number {
  return Math.min(Math.max(0, limits?.min?.[angle] ?? 0), limits?.max?.[angle] ?? 0);
}

/** Bends the joints of a digit, in the wrist's frame and OpenXR's axes, from stretched to its angles. */
function poseDigit(
  joints: (Rigid | undefined)[],
  digit: number,
  angles: DigitAngles,
  limits: DigitLimits | undefined,
  side: Handedness,
): void {
  // The three links and the tip; a finger's metacarpal does not move.
  const [first, second, third, tip] = DIGIT_JOINTS[digit]!.slice(-4) as [number, number, number, number];
  const links = [first, second, third, tip].flatMap((joint) => joints[joint] ?? []);
  if (links.length < 4) {
    return;
  }
  // Pitch turns about -X. Yaw turns about Y toward the little finger's side, and lifts the thumb.
  const pitch = (angle: number) => turnAbout({ x: -1, y: 0, z: 0 }, angle);
  const toLittle = side === Handedness.RIGHT ? -1 : 1;
  const yaw = (angle: number) => turnAbout({ x: 0, y: 1, z: 0 }, (digit === 0 ? -toLittle : toLittle) * angle);
  const thirdPitch = angles.thirdPitch ?? (angles.secondPitch * 2) / 3;

  const unbent = turns(turns(links[0]!.orientation, pitch(-stretched(limits, "basePitch"))), yaw(-stretched(limits, "baseYaw")));
  const bends = [angles.secondPitch - stretched(limits, "secondPitch"), thirdPitch - stretched(limits, "thirdPitch"), 0];
  let posed: Rigid = { position: links[0]!.position, orientation: turns(turns(unbent, yaw(angles.baseYaw)), pitch(angles.basePitch)) };
  joints[first] = posed;
  for (const [index, joint] of [second, third, tip].entries()) {
    const inParent = compose(inverse(links[index]!), links[index + 1]!);
    const { position, orientation } = compose(posed, inParent);
    posed = { position, orientation: turns(orientation, pitch(bends[index]!)) };
    joints[joint] = posed;
  }
}
