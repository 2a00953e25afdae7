/** Conversions between the conventions of engines, as the server makes them. */

import { clone, create } from "@bufbuild/protobuf";
import { Check, GraspSchema, type Grasp, type Verdict } from "./gen/grasp/v1/grasp_pb.js";
import { Convention, HandPoseSchema, Vector3Schema, type HandPose, type Vector3 } from "./gen/grasp/v1/holdout_pb.js";
import { inverseTurn, NO_TURN, poseMessage, rigid, scale, turned, turns, type Quat, type Rigid, type Vec3 } from "./pose.js";

interface Engine {
  /** An OpenXR vector in the engine's axes, and back. */
  from: (v: Vec3) => Vec3;
  to: (v: Vec3) => Vec3;
  /** Axes are left-handed. */
  mirrored?: boolean;
  unitsPerMeter?: number;
  /** The turn between an OpenXR joint and the engine's; its own inverse. */
  jointTurn?: Quat;
  /** The turn from the engine's axes to those of an imported object. */
  importerTurn?: Quat;
  wristFirst?: boolean;
}

const same = (v: Vec3): Vec3 => ({ x: v.x, y: v.y, z: v.z });
const flipZ = (v: Vec3): Vec3 => ({ x: v.x, y: v.y, z: -v.z });
const OPENXR: Engine = { from: same, to: same };
const UNITY: Engine = { from: flipZ, to: flipZ, mirrored: true, wristFirst: true };
const UNREAL: Engine = {
  from: (v) => ({ x: -v.z, y: v.x, z: v.y }),
  to: (v) => ({ x: v.y, y: v.z, z: -v.x }),
  mirrored: true,
  unitsPerMeter: 100,
};
const ENGINES: Record<Convention, Engine> = {
  [Convention.UNSPECIFIED]: OPENXR,
  [Convention.OPENXR]: OPENXR,
  [Convention.UNITY]: UNITY,
  [Convention.UNREAL]: UNREAL,
  [Convention.GODOT]: { ...OPENXR, jointTurn: { x: 0, y: -Math.SQRT1_2, z: Math.SQRT1_2, w: 0 } },
  [Convention.UNITY_FLIP_X]: { ...UNITY, importerTurn: { x: 0, y: 1, z: 0, w: 0 } },
  [Convention.UNREAL_XZY]: { ...UNREAL, importerTurn: { x: 0, y: 0, z: -Math.SQRT1_2, w: Math.SQRT1_2 } },
};

/** The lengths among the values of verdicts. */
const LENGTHS = new Set([
  Check.PENETRATION,
  Check.GIVER_CLEARANCE,
  Check.OTHER_HANDS_CLEARANCE,
  Check.OBSTACLE_CLEARANCE,
  Check.SELF_COLLISION,
  Check.FORBIDDEN,
  Check.REACH,
  Check.WIDTH,
]);

/**
 * Converts points, directions and poses between OpenXR's convention (right-handed, +Y up, meters; also WebXR's and three's) and
 * another one. Functions come in pairs: to OpenXR, and from it.
 */
export class Conversion {
  private readonly engine: Engine;

  constructor(convention: Convention) {
    this.engine = ENGINES[convention];
  }

  /** The convention's units per meter: 100 for Unreal, else 1. */
  get unitsPerMeter(): number {
    return this.engine.unitsPerMeter ?? 1;
  }

  /** A direction, or a force in newtons: the axes change, the length does not. */
  directionToOpenXr = (v: Vec3): Vec3 => this.engine.to(v);
  directionFromOpenXr = (v: Vec3): Vec3 => this.engine.from(v);

  /** A point. */
  pointToOpenXr = (p: Vec3): Vec3 => scale(this.engine.to(p), 1 / this.unitsPerMeter);
  pointFromOpenXr = (p: Vec3): Vec3 => scale(this.engine.from(p), this.unitsPerMeter);

  private turn(axis: Vec3, w: number): Quat {
    return this.engine.mirrored ? { ...scale(axis, -1), w } : { ...axis, w };
  }

  /** The pose of anything but joints and objects, such as a headset. */
  poseToOpenXr = ({ position, orientation: q }: Rigid): Rigid => ({
    position: this.pointToOpenXr(position),
    orientation: this.turn(this.engine.to(q), q.w),
  });
  poseFromOpenXr = ({ position, orientation: q }: Rigid): Rigid => ({
    position: this.pointFromOpenXr(position),
    orientation: this.turn(this.engine.from(q), q.w),
  });

  private jointTurned({ position, orientation }: Rigid): Rigid {
    return { position, orientation: turns(orientation, this.engine.jointTurn ?? NO_TURN) };
  }

  /** The pose of a hand's joint or wrist in the client's frame. */
  jointToOpenXr = (joint: Rigid): Rigid => this.jointTurned(this.poseToOpenXr(joint));
  jointFromOpenXr = (joint: Rigid): Rigid => this.poseFromOpenXr(this.jointTurned(joint));

  private get importerTurn(): Quat {
    return this.engine.importerTurn ?? NO_TURN;
  }

  /** The pose of an object, or of a model's root, in the client's frame. */
  objectToOpenXr = ({ position, orientation }: Rigid): Rigid =>
    this.poseToOpenXr({ position, orientation: turns(orientation, this.importerTurn) });
  objectFromOpenXr = (object: Rigid): Rigid => {
    const { position, orientation } = this.poseFromOpenXr(object);
    return { position, orientation: turns(orientation, inverseTurn(this.importerTurn)) };
  };

  /** The pose of a joint in an object's frame. */
  jointAtObjectToOpenXr = (joint: Rigid): Rigid => this.jointToOpenXr(turnedAsWhole(inverseTurn(this.importerTurn), joint));
  jointAtObjectFromOpenXr = (joint: Rigid): Rigid => turnedAsWhole(this.importerTurn, this.jointFromOpenXr(joint));

  /** A point in an object's frame. */
  pointAtObjectToOpenXr = (p: Vec3): Vec3 => this.pointToOpenXr(turned(inverseTurn(this.importerTurn), p));
  pointAtObjectFromOpenXr = (p: Vec3): Vec3 => turned(this.importerTurn, this.pointFromOpenXr(p));

  /** A direction or force in an object's frame. */
  directionAtObjectToOpenXr = (v: Vec3): Vec3 => this.directionToOpenXr(turned(inverseTurn(this.importerTurn), v));
  directionAtObjectFromOpenXr = (v: Vec3): Vec3 => turned(this.importerTurn, this.directionFromOpenXr(v));

  /** The OpenXR index of the joint at a place in the convention's list of 26, and the reverse. */
  jointAt(place: number): number {
    return this.engine.wristFirst && place < 2 ? 1 - place : place;
  }
}

function turnedAsWhole(turn: Quat, { position, orientation }: Rigid): Rigid {
  return { position: turned(turn, position), orientation: turns(turn, orientation) };
}

/** The functions that convert from one convention to another, through OpenXR's. */
function between(from: Convention, to: Convention) {
  const [a, b] = [new Conversion(from), new Conversion(to)];
  const point = (convert: (v: Vec3) => Vec3) => (v: Vector3 | undefined) => v && create(Vector3Schema, convert(v));
  return {
    length: (value: number) => (value * b.unitsPerMeter) / a.unitsPerMeter,
    point: point((p) => b.pointFromOpenXr(a.pointToOpenXr(p))),
    pointAtObject: point((p) => b.pointAtObjectFromOpenXr(a.pointAtObjectToOpenXr(p))),
    directionAtObject: point((v) => b.directionAtObjectFromOpenXr(a.directionAtObjectToOpenXr(v))),
    joint: (joint: Rigid) => b.jointFromOpenXr(a.jointToOpenXr(joint)),
    jointAtObject: (joint: Rigid) => b.jointAtObjectFromOpenXr(a.jointAtObjectToOpenXr(joint)),
    object: (object: Rigid) => b.objectFromOpenXr(a.objectToOpenXr(object)),
    place: (place: number) => a.jointAt(b.jointAt(place)),
  };
}

/** A hand in another convention: a copy. The hand names its own; unspecified is OpenXR's. */
export function convertHand(hand: HandPose, convention: Convention): HandPose {
  const by = between(hand.convention, convention);
  const { clientFromWrist, objectFromWrist, joints, model } = hand;
  const converted = clone(HandPoseSchema, hand);
  converted.convention = convention;
  converted.clientFromWrist = clientFromWrist && poseMessage(by.joint(rigid(clientFromWrist)));
  converted.objectFromWrist = objectFromWrist && poseMessage(by.jointAtObject(rigid(objectFromWrist)));
  for (const [place, joint] of converted.joints.entries()) {
    const { pose, radius } = joints[by.place(place)]!;
    joint.pose = pose && poseMessage(by.joint(rigid(pose)));
    joint.radius = by.length(radius);
  }
  // The nodes below the root are in the file's axes.
  const [root] = converted.model;
  if (root) {
    root.pose = poseMessage(by.object(rigid(model[0]!.pose)));
  }
  return converted;
}

/** A grasp in another convention: a copy. Its hand names its own. Words in descriptions stay as they are. */
export function convertGrasp(grasp: Grasp, convention: Convention): Grasp {
  const by = between(grasp.hand?.convention ?? Convention.OPENXR, convention);
  const converted = clone(GraspSchema, grasp);
  converted.hand = grasp.hand && convertHand(grasp.hand, convention);
  for (const contact of converted.contacts) {
    contact.position = by.pointAtObject(contact.position);
    contact.normal = by.directionAtObject(contact.normal);
    contact.force = by.directionAtObject(contact.force);
  }
  for (const margin of converted.margins) {
    convertVerdict(margin, by);
  }
  for (const keyFrame of converted.keyFrames) {
    keyFrame.hand = keyFrame.hand && convertHand(keyFrame.hand, convention);
  }
  if (converted.arm) {
    converted.arm.clientShoulder = by.point(converted.arm.clientShoulder);
    converted.arm.clientElbow = by.point(converted.arm.clientElbow);
  }
  return converted;
}

function convertVerdict(verdict: Verdict, by: ReturnType<typeof between>): void {
  verdict.where = by.point(verdict.where);
  if (LENGTHS.has(verdict.check)) {
    verdict.value = verdict.value === undefined ? undefined : by.length(verdict.value);
    verdict.bound = verdict.bound === undefined ? undefined : by.length(verdict.bound);
  }
}
