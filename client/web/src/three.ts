/** Poses skinned hands and objects in three.js. */

import { Matrix4, PropertyBinding, Quaternion, Vector3, type Object3D } from "three";
import { convertHand } from "./conventions.js";
import { Convention, type HandJoints, type HandPose, type Pose } from "./gen/grasp/v1/holdout_pb.js";
import { jointsOf } from "./hand.js";
import { rigid, type Rigid } from "./pose.js";

/** The matrix of a transform in OpenXR's axes, which are three's. */
export function matrixOf({ position, orientation }: Rigid, size = 1): Matrix4 {
  const { x, y, z, w } = orientation;
  return new Matrix4().compose(new Vector3(position.x, position.y, position.z), new Quaternion(x, y, z, w), new Vector3(size, size, size));
}

/** Places an object as a message says, in its parent's frame. */
export function place(object: Object3D, pose: Pose | undefined): void {
  const { position, orientation } = rigid(pose);
  object.position.copy(position as Vector3);
  object.quaternion.set(orientation.x, orientation.y, orientation.z, orientation.w);
}

/** The transform of an object in the world, for requests. */
export function poseOf(object: Object3D): Rigid {
  object.updateWorldMatrix(true, false);
  const [position, orientation] = [new Vector3(), new Quaternion()];
  object.matrixWorld.decompose(position, orientation, new Vector3());
  return {
    position: { x: position.x, y: position.y, z: position.z },
    orientation: { x: orientation.x, y: orientation.y, z: orientation.z, w: orientation.w },
  };
}

/**
 * Poses a skinned hand whose bones have the names and axes of WebXR's joints, such as the GLB files of `assets/hands`, the generic hand
 * of `@webxr-input-profiles/assets`, or the controller of three's `XRHandMeshModel`. Every bone goes to its joint, wherever
 * the root is in the scene. `space` is the object whose frame is the client's, by default the world.
 */
export function poseHand(root: Object3D, hand: HandPose | HandJoints, space?: Object3D): void {
  root.updateWorldMatrix(true, true);
  // Bounds of skinned meshes are those of their first pose: hands that left them would not be drawn.
  root.traverse((object) => (object.frustumCulled = false));
  const size = "scale" in hand ? hand.scale : 1;
  for (const { name, pose } of jointsOf(hand)) {
    const bone = root.getObjectByName(name);
    if (bone) {
      moveTo(bone, matrixOf(pose, size), space);
    }
  }
}

/**
 * Poses the model that the hand's rig was created from (`createRig` with `models`), loaded by three's GLTFLoader: the hand's root goes to
 * its place, the nodes below it turn in their parents. `space` is as in `poseHand`.
 */
export function poseModel(root: Object3D, hand: HandPose, space?: Object3D): void {
  root.updateWorldMatrix(true, true);
  root.traverse((object) => (object.frustumCulled = false));
  for (const [index, { node, pose }] of convertHand(hand, Convention.OPENXR).model.entries()) {
    const object = root.getObjectByName(PropertyBinding.sanitizeNodeName(node));
    if (!object) {
      continue;
    }
    if (index === 0) {
      moveTo(object, matrixOf(rigid(pose), hand.scale), space);
    } else {
      const { x, y, z } = pose?.position ?? object.position;
      const { orientation } = rigid(pose);
      object.position.set(x, y, z);
      object.quaternion.set(orientation.x, orientation.y, orientation.z, orientation.w);
    }
  }
}

/** Moves an object to a place in a space. Its parents' matrices have to be up to date. */
function moveTo(object: Object3D, spaceFromObject: Matrix4, space: Object3D | undefined): void {
  space?.updateWorldMatrix(true, false);
  const parentFromSpace = (object.parent?.matrixWorld.clone().invert() ?? new Matrix4()).multiply(space?.matrixWorld ?? new Matrix4());
  spaceFromObject.premultiply(parentFromSpace).decompose(object.position, object.quaternion, object.scale);
  object.updateWorldMatrix(false, false);
}
