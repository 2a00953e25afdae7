/** The contract's values in words. */
import { Check, CurrentGraspStatus, type Grasp, GraspSource, Outcome, type Verdict } from "#contract/grasp_pb";
import { GraspType } from "#contract/grasp_type_pb";
import { Digit, Handedness } from "#contract/holdout_pb";

function sentence(name: string | undefined): string {
  const text = (name ?? "").toLowerCase().replaceAll("_", " ");
  return text.charAt(0).toUpperCase() + text.slice(1);
}

export const typeName = (type: GraspType) => (type === GraspType.UNSPECIFIED ? "No named type" : sentence(GraspType[type]));
export const checkName = (check: Check) => sentence(Check[check]);
export const statusName = (status: CurrentGraspStatus) => sentence(CurrentGraspStatus[status]);
export const sourceName = (source: GraspSource) => sentence(GraspSource[source]);
export const digitName = (digit: Digit) => (digit === Digit.UNSPECIFIED ? "Palm" : sentence(Digit[digit]));
export const handName = (hand: Handedness) => (hand === Handedness.LEFT ? "left hand" : "right hand");

export function outcomeName(outcome: Outcome): string {
  return { [Outcome.UNSPECIFIED]: "Searching", [Outcome.FOUND]: "Found", [Outcome.BUDGET_EXHAUSTED]: "No grasp in time", [Outcome.ABORTED]: "Aborted" }[outcome];
}

export const objectName = (name: string) => name.replace(/^objects\//, "");

export function milliseconds(ms: number): string {
  return ms < 10 ? `${ms.toFixed(1)} ms` : `${Math.round(ms)} ms`;
}

/** A verdict's value in the unit of its check. */
export function valueOf({ check, value }: Verdict): string {
  if (value === undefined) return "";
  switch (check) {
    case Check.PENETRATION:
    case Check.GIVER_CLEARANCE:
    case Check.OTHER_HANDS_CLEARANCE:
    case Check.OBSTACLE_CLEARANCE:
    case Check.SELF_COLLISION:
    case Check.FORBIDDEN:
    case Check.REACH:
      return Math.abs(value) > 10 ? "clear" : `${(1000 * value).toFixed(1)} mm`;
    case Check.BALANCE:
      return `${(100 * value).toFixed(1)} % unbalanced`;
    default:
      return value.toPrecision(3);
  }
}

const SIDES = ["right", "left", "top", "bottom", "front", "back"] as const;

/** The side of the object, along the axes of its frame, from which the hand comes. */
export function sideOfObject(grasp: Grasp): (typeof SIDES)[number] {
  const wrist = grasp.hand?.objectFromWrist?.position;
  const along = [wrist?.x ?? 0, wrist?.y ?? 0, wrist?.z ?? 0];
  const axis = along.map(Math.abs).indexOf(Math.max(...along.map(Math.abs)));
  return SIDES[2 * axis + (along[axis]! < 0 ? 1 : 0)]!;
}
