/** An arm of two bones. */

import { add, cross, dot, length, scale, sub, unit, type Vec3 } from "./pose.js";

/** Where the joints of an arm are. */
export interface BentArm {
  elbow: Vec3;
  /** At the target, or as near to it as the arm reaches. */
  wrist: Vec3;
}

/**
 * Bends an arm so that its wrist is at `target`, with the elbow on the side of `pole`, a point such as `Grasp.arm`'s elbow. Lengths are
 * those of upper arm and forearm, in the points' unit. A target out of reach is met in direction.
 */
export function bendArm(shoulder: Vec3, target: Vec3, pole: Vec3, upperArm: number, forearm: number): BentArm {
  const way = sub(target, shoulder);
  const along = unit(way);
  const distance = Math.min(upperArm + forearm, Math.max(Math.abs(upperArm - forearm), length(way)));
  const toPole = sub(pole, shoulder);
  // A pole on the line has no side: any perpendicular will do.
  const perpendicular = cross(along, Math.abs(along.y) < 0.9 ? { x: 0, y: 1, z: 0 } : { x: 1, y: 0, z: 0 });
  const aside = unit(sub(toPole, scale(along, dot(toPole, along))), unit(perpendicular));
  // The law of cosines.
  const before = distance > 0 ? (distance ** 2 + upperArm ** 2 - forearm ** 2) / (2 * distance) : 0;
  const off = Math.sqrt(Math.max(0, upperArm ** 2 - before ** 2));
  return {
    elbow: add(shoulder, add(scale(along, before), scale(aside, off))),
    wrist: add(shoulder, scale(along, distance)),
  };
}
