/** Poses as arrays, as three.js has them and as the contract has them. All are in OpenXR's axes and meters. */
import { Matrix4, Quaternion, Vector3 } from "three";

import type { Pose as WirePose, Quaternion as WireQuaternion, Vector3 as WireVector } from "#contract/holdout_pb";

/** A rigid transform: position x, y, z and quaternion x, y, z, w. */
export interface Pose {
  p: [number, number, number];
  q: [number, number, number, number];
}

export const IDENTITY: Pose = { p: [0, 0, 0], q: [0, 0, 0, 1] };

export function vector(wire: WireVector | undefined): Vector3 {
  return wire ? new Vector3(wire.x, wire.y, wire.z) : new Vector3();
}

export function quaternion(wire: WireQuaternion | undefined): Quaternion {
  return wire ? new Quaternion(wire.x, wire.y, wire.z, wire.w).normalize() : new Quaternion();
}

const ONE = new Vector3(1, 1, 1);

export function matrix(pose: Pose): Matrix4 {
  return new Matrix4().compose(new Vector3(...pose.p), new Quaternion(...pose.q), ONE);
}

export function wireMatrix(pose: WirePose | undefined): Matrix4 {
  return new Matrix4().compose(vector(pose?.position), quaternion(pose?.orientation), ONE);
}

/** The pose of a matrix without its scale. */
export function poseOf(matrix: Matrix4): Pose {
  const [position, orientation] = [new Vector3(), new Quaternion()];
  matrix.decompose(position, orientation, new Vector3());
  const { x, y, z, w } = orientation.normalize();
  return { p: [position.x, position.y, position.z], q: [x, y, z, w] };
}

export function wirePose({ p: [x, y, z], q }: Pose) {
  return { position: { x, y, z }, orientation: { x: q[0], y: q[1], z: q[2], w: q[3] } };
}

/** The pose a share of the way between two. */
export function between(a: Pose, b: Pose, share: number): Pose {
  const p = new Vector3(...a.p).lerp(new Vector3(...b.p), share);
  const { x, y, z, w } = new Quaternion(...a.q).slerp(new Quaternion(...b.q), share);
  return { p: [p.x, p.y, p.z], q: [x, y, z, w] };
}
