/** Vectors, quaternions and rigid transforms as plain values. */

import { create } from "@bufbuild/protobuf";
import { PoseSchema, type Pose } from "./gen/grasp/v1/holdout_pb.js";

/** A point or a direction. */
export interface Vec3 {
  x: number;
  y: number;
  z: number;
}

/** A rotation, as a unit quaternion. */
export interface Quat extends Vec3 {
  w: number;
}

/** A rigid transform: `a_from_b` has the origin and the orientation of frame b in frame a. */
export interface Rigid {
  position: Vec3;
  orientation: Quat;
}

export const ORIGIN: Vec3 = { x: 0, y: 0, z: 0 };
export const NO_TURN: Quat = { x: 0, y: 0, z: 0, w: 1 };

export const add = (a: Vec3, b: Vec3): Vec3 => ({ x: a.x + b.x, y: a.y + b.y, z: a.z + b.z });
export const sub = (a: Vec3, b: Vec3): Vec3 => ({ x: a.x - b.x, y: a.y - b.y, z: a.z - b.z });
export const scale = (v: Vec3, by: number): Vec3 => ({ x: v.x * by, y: v.y * by, z: v.z * by });
export const dot = (a: Vec3, b: Vec3): number => a.x * b.x + a.y * b.y + a.z * b.z;
export const length = (v: Vec3): number => Math.hypot(v.x, v.y, v.z);
export const mix = (a: Vec3, b: Vec3, t: number): Vec3 => add(a, scale(sub(b, a), t));

export function cross(a: Vec3, b: Vec3): Vec3 {
  return { x: a.y * b.z - a.z * b.y, y: a.z * b.x - a.x * b.z, z: a.x * b.y - a.y * b.x };
}

/** The unit vector along `v`; `otherwise` if it has no direction. */
export function unit(v: Vec3, otherwise: Vec3 = { x: 0, y: 1, z: 0 }): Vec3 {
  const size = length(v);
  return size > 1e-9 ? scale(v, 1 / size) : otherwise;
}

/** The turn about a unit axis by an angle in radians. */
export function turnAbout(axis: Vec3, angle: number): Quat {
  return { ...scale(axis, Math.sin(angle / 2)), w: Math.cos(angle / 2) };
}

export const inverseTurn = (q: Quat): Quat => ({ x: -q.x, y: -q.y, z: -q.z, w: q.w });

/** The turn by `b`, then by `a`. */
export function turns(a: Quat, b: Quat): Quat {
  return {
    x: a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
    y: a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
    z: a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
    w: a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
  };
}

/** A vector turned by a unit quaternion. */
export function turned(q: Quat, v: Vec3): Vec3 {
  const t = scale(cross(q, v), 2);
  return add(add(v, scale(t, q.w)), cross(q, t));
}

/** The quaternion of length one along `q`. */
export function normalized(q: Quat): Quat {
  const size = Math.hypot(q.x, q.y, q.z, q.w);
  return size > 0 ? { ...scale(q, 1 / size), w: q.w / size } : NO_TURN;
}

/** The turn from `a` to `b` at the share `t` of the shorter way. */
export function slerp(a: Quat, b: Quat, t: number): Quat {
  const cosine = dot(a, b) + a.w * b.w;
  const angle = Math.acos(Math.min(1, Math.abs(cosine)));
  // Nearly equal turns are mixed: the sine below would vanish.
  const [from, to] = angle < 1e-4 ? [1 - t, t] : [Math.sin((1 - t) * angle), Math.sin(t * angle)];
  const toward = cosine < 0 ? -to : to;
  return normalized({ ...add(scale(a, from), scale(b, toward)), w: a.w * from + b.w * toward });
}

/** `a_from_c`, from `a_from_b` and `b_from_c`. */
export function compose(aFromB: Rigid, bFromC: Rigid): Rigid {
  return {
    position: add(aFromB.position, turned(aFromB.orientation, bFromC.position)),
    orientation: turns(aFromB.orientation, bFromC.orientation),
  };
}

/** `b_from_a`, from `a_from_b`. */
export function inverse(aFromB: Rigid): Rigid {
  const back = inverseTurn(aFromB.orientation);
  return { position: scale(turned(back, aFromB.position), -1), orientation: back };
}

/** A message's transform; absent parts are the identity's. */
export function rigid(pose: Pose | undefined): Rigid {
  return { position: pose?.position ?? ORIGIN, orientation: pose?.orientation ?? NO_TURN };
}

/** The message of a transform. */
export function poseMessage({ position, orientation }: Rigid): Pose {
  const { x, y, z } = position;
  return create(PoseSchema, {
    position: { x, y, z },
    orientation: { x: orientation.x, y: orientation.y, z: orientation.z, w: orientation.w },
  });
}
