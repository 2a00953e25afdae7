/** Poses an arm and hand of a VRM avatar with three-vrm. */

import { VRMHumanBoneParentMap, type VRM, type VRMHumanBoneName } from "@pixiv/three-vrm";
import { Matrix4, Quaternion, Vector3, type Object3D } from "three";
import type { Arm } from "./gen/grasp/v1/grasp_pb.js";
import type { HandRig } from "./gen/grasp/v1/hand_rig_service_pb.js";
import { Handedness, type HandPose } from "./gen/grasp/v1/holdout_pb.js";
import { DIGIT_JOINTS, JOINT_NAMES, jointsOf } from "./hand.js";
import { bendArm } from "./ik.js";
import { rigid, type Quat, type Vec3 } from "./pose.js";
import { poseOf } from "./three.js";

/** A bone of a digit, and how its turn at rest relates to that of the rig's link. */
interface Link {
  bone: Object3D;
  joint: string;
  /** The inverse of the stretched link's orientation, then the turn from the bone at rest to that link, in the wrist's frame. */
  stretchedFromRest: Quaternion;
}

const UP = new Vector3(0, 1, 0);
const vector = ({ x, y, z }: Vec3) => new Vector3(x, y, z);
const quaternion = ({ x, y, z, w }: Quat) => new Quaternion(x, y, z, w);

/** The turn from the frame of two directions to another: the first match, the second as far as they can. */
function turnBetween(from: [Vector3, Vector3], to: [Vector3, Vector3]): Quaternion {
  const [a, b] = [from, to].map(([first, second]) => {
    const z = first.clone().normalize();
    const x = second.clone().cross(z).normalize();
    return new Quaternion().setFromRotationMatrix(new Matrix4().makeBasis(x, z.clone().cross(x), z));
  }) as [Quaternion, Quaternion];
  return b.multiply(a.invert());
}

/**
 * One arm of an avatar, VRM 0.x or 1.0. Its bones turn so that its digits point as the joints of a grasp's hand, by a rig: best
 * the avatar's own, created from its file, so that contacts are where its fingertips are. The wrist gets to its place by the arm.
 */
export class VrmArm {
  private readonly links: Link[][];
  private readonly hand: Object3D;
  private readonly upperArm: Object3D;
  private readonly lowerArm: Object3D;
  private readonly wristFromModel: Quaternion;
  private readonly upperRest: Vector3;
  private readonly lowerRest: Vector3;
  /** The axis of the elbow at rest. */
  private readonly hingeRest: Vector3;

  /** Throws an `Error` if the avatar or the rig lacks the hand. `space` is the object whose frame is the client's, by default the world. */
  constructor(
    private readonly vrm: VRM,
    private readonly rig: HandRig,
    private readonly handedness: Handedness.LEFT | Handedness.RIGHT,
    private readonly space?: Object3D,
  ) {
    vrm.humanoid.update();
    const stretched = rig.hands.find((hand) => hand.handedness === handedness)?.stretchedJoints.map(({ pose }) => pose && rigid(pose));
    if (!stretched) {
      throw new Error(`${rig.name} lacks the hand`);
    }
    [this.upperArm, this.lowerArm, this.hand] = ["UpperArm", "LowerArm", "Hand"].map((part) => this.bone(part)) as [
      Object3D,
      Object3D,
      Object3D,
    ];
    const [shoulder, elbow, wrist] = ["UpperArm", "LowerArm", "Hand"].map((part) => this.rest(part)!) as [Vector3, Vector3, Vector3];
    this.upperRest = elbow.clone().sub(shoulder);
    this.lowerRest = wrist.clone().sub(elbow);
    // From straight, the elbow bends forward.
    const left = this.upperRest.clone().multiplyScalar(handedness === Handedness.LEFT ? 1 : -1);
    this.hingeRest = this.upperRest.clone().cross(left.cross(UP));

    const knuckles = ["IndexProximal", "MiddleProximal", "RingProximal", "LittleProximal"].flatMap((part, finger) => {
      const [rest, link] = [this.rest(part), stretched[DIGIT_JOINTS[finger + 1]![1]!]];
      return rest && link ? { rest: rest.sub(wrist), link: vector(link.position) } : [];
    });
    this.wristFromModel = this.fitted(knuckles);
    this.links = ["Thumb", "Index", "Middle", "Ring", "Little"].map((digit, index) => {
      const parts = index === 0 ? ["Metacarpal", "Proximal", "Distal"] : ["Proximal", "Intermediate", "Distal"];
      const joints = DIGIT_JOINTS[index]!.slice(-4, -1);
      let restToStretched = new Quaternion();
      return parts.flatMap((part, link): Link[] => {
        const [bone, joint] = [this.findBone(digit + part), stretched[joints[link]!]];
        if (!bone || !joint) {
          return [];
        }
        const along = this.along(digit + part, digit + parts[link + 1]);
        if (along) {
          along.applyQuaternion(this.wristFromModel);
          const wanted = new Vector3(0, 0, -1).applyQuaternion(quaternion(joint.orientation));
          restToStretched = new Quaternion().setFromUnitVectors(along.normalize(), wanted);
        }
        // A last bone without an end is turned like the one before it.
        const stretchedFromRest = quaternion(joint.orientation).invert().multiply(restToStretched);
        return [{ bone, joint: JOINT_NAMES[joints[link]!]!, stretchedFromRest }];
      });
    });
  }

  private findBone(part: string): Object3D | null {
    return this.vrm.humanoid.getNormalizedBoneNode(this.boneName(part));
  }

  private boneName(part: string): VRMHumanBoneName {
    return `${this.handedness === Handedness.LEFT ? "left" : "right"}${part}` as VRMHumanBoneName;
  }

  private bone(part: string): Object3D {
    const bone = this.findBone(part);
    if (!bone) {
      throw new Error(`the avatar has no ${this.boneName(part)}`);
    }
    return bone;
  }

  /** Where a bone is at rest, in the model's frame. */
  private rest(part: string): Vector3 | undefined {
    const { humanoid } = this.vrm;
    if (!this.findBone(part)) {
      return undefined;
    }
    const place = new Vector3();
    for (let name: VRMHumanBoneName | null = this.boneName(part); name; name = VRMHumanBoneParentMap[name]) {
      const position = humanoid.normalizedRestPose[name]?.position;
      if (position) {
        place.add(new Vector3(...position));
      }
    }
    return place;
  }

  /** From a bone to the next one at rest, or to its end if the model has one. */
  private along(part: string, next: string): Vector3 | undefined {
    const [from, to] = [this.rest(part), this.rest(next)];
    if (from && to) {
      return to.sub(from);
    }
    const end = this.vrm.humanoid.getRawBoneNode(this.boneName(part))?.children.find(({ position }) => position.length() > 0);
    if (!end) {
      return undefined;
    }
    // The model may be posed: its normalized bone says how the bone has turned since.
    const turn = this.bone(part).getWorldQuaternion(new Quaternion()).invert();
    return end.getWorldPosition(new Vector3()).sub(end.parent!.getWorldPosition(new Vector3())).applyQuaternion(turn);
  }

  /** The turn of the model at rest to the rig's wrist: by the knuckles, or by the T-pose for hands without fingers. */
  private fitted(knuckles: { rest: Vector3; link: Vector3 }[]): Quaternion {
    const [first, last] = [knuckles[0], knuckles.at(-1)];
    if (!first || !last || first === last) {
      return turnBetween([this.lowerRest, UP], [new Vector3(0, 0, -1), UP]);
    }
    const directions = (of: "rest" | "link"): [Vector3, Vector3] => [
      knuckles.reduce((sum, knuckle) => sum.add(knuckle[of]), new Vector3()),
      first[of].clone().sub(last[of]),
    ];
    return turnBetween(directions("rest"), directions("link"));
  }

  private get clientFromWorld(): Matrix4 {
    this.space?.updateWorldMatrix(true, false);
    return this.space?.matrixWorld.clone().invert() ?? new Matrix4();
  }

  /** Lengths in the world over those in the model. */
  private get size(): number {
    return this.vrm.scene.getWorldScale(new Vector3()).x;
  }

  /** The `receiver` of requests: this hand, with the arm as the avatar stands now. */
  get receiver() {
    const shoulder = vector(poseOf(this.upperArm).position).applyMatrix4(this.clientFromWorld);
    return {
      rig: this.rig.name,
      handedness: this.handedness,
      body: { case: "clientShoulder" as const, value: { x: shoulder.x, y: shoulder.y, z: shoulder.z } },
      upperArmLength: this.upperRest.length() * this.size,
      forearmLength: this.lowerRest.length() * this.size,
    };
  }

  /**
   * Poses arm and hand, to be drawn after `vrm.update`. `arm`, that of the grasp, says where the elbow goes; without it, it hangs. Returns
   * how far the wrist stays from its place, in meters: 0 if the arm reaches it.
   */
  pose(hand: HandPose, arm?: Arm): number {
    const worldFromClient = this.clientFromWorld.invert();
    const turn = new Quaternion().setFromRotationMatrix(worldFromClient);
    const joints = new Map(jointsOf(hand).map(({ name, pose }) => [name, pose]));
    const wrist = joints.get("wrist");
    if (!wrist) {
      return 0;
    }
    const clientFromWrist = quaternion(wrist.orientation);
    const handTurn = turn.clone().multiply(clientFromWrist).multiply(this.wristFromModel);
    const missed = this.poseArm(vector(wrist.position).applyMatrix4(worldFromClient), handTurn, arm, worldFromClient);
    turnTo(this.hand, handTurn);
    for (const links of this.links) {
      for (const { bone, joint, stretchedFromRest } of links) {
        const pose = joints.get(joint);
        if (pose) {
          turnTo(bone, turn.clone().multiply(quaternion(pose.orientation)).multiply(stretchedFromRest).multiply(this.wristFromModel));
        }
      }
    }
    return missed;
  }

  private poseArm(target: Vector3, handTurn: Quaternion, arm: Arm | undefined, worldFromClient: Matrix4): number {
    const shoulder = vector(poseOf(this.upperArm).position);
    const pole = arm?.clientElbow ? vector(arm.clientElbow).applyMatrix4(worldFromClient) : shoulder.clone().sub(UP);
    const [upperLength, lowerLength] = [this.upperRest, this.lowerRest].map((bone) => bone.length() * this.size) as [number, number];
    const bent = bendArm(shoulder, target, pole, upperLength, lowerLength);
    const upper = vector(bent.elbow).sub(shoulder);
    const lower = vector(bent.wrist).sub(bent.elbow as Vector3);
    // A straight arm has no plane of its own.
    const hinge = upper.clone().cross(lower);
    if (hinge.length() < 1e-6) {
      hinge.crossVectors(pole.clone().sub(shoulder), upper);
    }
    turnTo(this.upperArm, turnBetween([this.upperRest, this.hingeRest], [upper, hinge]));
    const lowerTurn = turnBetween([this.lowerRest, this.hingeRest], [lower, hinge]);
    // The forearm takes half of the hand's twist.
    const toHand = lowerTurn.clone().invert().multiply(handTurn);
    const along = this.lowerRest.clone().normalize();
    const twist = 2 * Math.atan2(along.dot(toHand as unknown as Vector3), toHand.w);
    const shorter = twist - 2 * Math.PI * Math.round(twist / (2 * Math.PI));
    turnTo(this.lowerArm, lowerTurn.multiply(new Quaternion().setFromAxisAngle(along, shorter / 2)));
    return target.distanceTo(bent.wrist as Vector3);
  }
}

/** Turns a normalized bone so that vectors of the model at rest turn by `worldTurn`. */
function turnTo(bone: Object3D, worldTurn: Quaternion): void {
  const parent = bone.parent!;
  parent.updateWorldMatrix(true, false);
  bone.quaternion.copy(parent.getWorldQuaternion(new Quaternion()).invert().multiply(worldTurn));
  bone.updateWorldMatrix(false, false);
}
