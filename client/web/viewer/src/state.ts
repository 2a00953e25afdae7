/** What the page shows: kept in the link, with undo and redo. */
import type { MessageInitShape } from "@bufbuild/protobuf";
import { Matrix4, Quaternion } from "three";

import holdouts from "#holdouts";
import type { FindGraspRequestSchema } from "#contract/grasp_service_pb";
import type { Angles, HandRigSide, Side } from "./kinematics";
import { handedness, wireDigits } from "./kinematics";
import { IDENTITY, matrix, poseOf, wirePose, type Pose } from "./poses";

/** The giver's hand. */
export interface Giver {
  rig: string;
  side: Side;
  scale: number;
  wrist: Pose;
  digits: Angles[];
  /** From -1, closed as far as the hand bends, over 0, as it holds, to 1, stretched. */
  open: number;
}

export interface State {
  /** "objects/remote". */
  object: string;
  /** Name of the built-in holdout; empty for others. */
  holdout: string;
  pose: Pose;
  scale: number;
  giver: Giver | null;
  /** Hand to pose; empty for the better one. */
  receiver: Side | "";
  /** Rig of the hand to pose; empty for the server's default. */
  rig: string;
}

/** The half turn between the axes of holdout files and those of OpenXR. */
const FILE_FROM_OPENXR = new Matrix4().makeRotationFromQuaternion(new Quaternion(0, Math.SQRT1_2, -Math.SQRT1_2, 0));

export const HOLDOUTS: { name: string; state: State }[] = holdouts.map((file) => {
  const wrist: Pose = { p: file.world_from_giver_wrist.position, q: file.world_from_giver_wrist.orientation };
  return {
    name: file.name,
    state: {
      object: `objects/${file.object}`,
      holdout: file.name,
      pose: { p: file.world_from_object.position, q: file.world_from_object.orientation },
      scale: 1,
      giver: {
        rig: `rigs/${file.giver_rig}`,
        side: file.giver_handedness,
        scale: 1,
        wrist: poseOf(matrix(wrist).multiply(FILE_FROM_OPENXR)),
        digits: file.giver_digits.map((digit) => [digit.base_yaw, digit.base_pitch, digit.second_pitch, digit.third_pitch]),
        open: 0,
      },
      receiver: "",
      rig: "",
    },
  };
});

/** The state for an object: its first built-in holdout, or nobody who holds it. */
export function stateFor(object: string): State {
  const found = HOLDOUTS.find(({ state }) => state.object === object);
  return structuredClone(found?.state ?? { object, holdout: "", pose: IDENTITY, scale: 1, giver: null, receiver: "", rig: "" });
}

/** A giver's angles with the fingers opened or closed. */
export function givenDigits(giver: Giver, rig: HandRigSide): Angles[] {
  return giver.digits.map((held, digit) => {
    const end: Angles =
      giver.open > 0 ? rig.rest(digit) : rig.clamped(digit, [held[0], held[1] + 0.9, held[2] + 0.9, held[3] + 0.7]);
    const share = Math.abs(giver.open);
    return rig.clamped(digit, held.map((angle, i) => angle + share * (end[i]! - angle)) as Angles);
  });
}

/** The state as the contract's holdout. */
export function wireHoldout(state: State, rigOf: (giver: Giver) => HandRigSide | undefined) {
  const { giver } = state;
  const rig = giver && rigOf(giver);
  return {
    object: state.object,
    clientFromObject: wirePose(state.pose),
    ...(state.scale === 1 ? {} : { scale: state.scale }),
    ...(giver && {
      presentingHand: {
        form: {
          case: "pose" as const,
          value: {
            rig: giver.rig,
            handedness: handedness(giver.side),
            ...(giver.scale === 1 ? {} : { scale: giver.scale }),
            clientFromWrist: wirePose(giver.wrist),
            ...wireDigits(rig ? givenDigits(giver, rig) : giver.digits),
          },
        },
      },
    }),
  };
}

export function wireReceiver(state: State) {
  return { rig: state.rig, ...(state.receiver && { handedness: handedness(state.receiver) }) };
}

/** The request for a grasp of the state. */
export function findRequest(state: State, rigOf: (giver: Giver) => HandRigSide | undefined): MessageInitShape<typeof FindGraspRequestSchema> {
  return { holdout: wireHoldout(state, rigOf), receiver: wireReceiver(state), output: { keyFrames: true } };
}

const round = (_: string, value: unknown) => (typeof value === "number" ? Number(value.toFixed(5)) : value);

export function toHash(state: State): string {
  const bytes = new TextEncoder().encode(JSON.stringify(state, round));
  return btoa(String.fromCharCode(...bytes)).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** The state of a link; `null` if it has none, or a damaged one. */
export function fromHash(hash: string): State | null {
  try {
    const bytes = Uint8Array.from(atob(hash.replace(/^#/, "").replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
    const state = { ...stateFor(""), ...(JSON.parse(new TextDecoder().decode(bytes)) as State) };
    const poses = [state.pose, ...(state.giver ? [state.giver.wrist] : [])];
    const isSound = poses.every(({ p, q }) => p.length === 3 && q.length === 4 && [...p, ...q].every(Number.isFinite));
    return isSound && state.object.startsWith("objects/") ? state : null;
  } catch {
    return null;
  }
}

/** What a change asks for: a new grasp, the present one to follow, or neither. */
export type Change = "find" | "follow";

const UNDOABLE = 200;

export class Store {
  private past: State[] = [];
  private future: State[] = [];
  /** The state before a gesture that is going on. */
  private before: State | null = null;

  constructor(
    public state: State,
    private readonly changed: (change: Change) => void,
  ) {}

  /** Replaces the state by one step that can be undone. */
  set(state: State, change: Change): void {
    this.remember(this.before ?? this.state);
    this.before = null;
    this.state = state;
    this.changed(change);
  }

  edit(patch: Partial<State>, change: Change): void {
    this.set({ ...this.state, ...patch }, change);
  }

  /** Changes the state within a gesture, which is one step from its beginning to `end`. */
  drag(patch: Partial<State>): void {
    this.before ??= this.state;
    this.state = { ...this.state, ...patch };
    this.changed("follow");
  }

  end(): void {
    if (this.before) this.remember(this.before);
    this.before = null;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  undo(): void {
    this.move(this.past, this.future);
  }

  redo(): void {
    this.move(this.future, this.past);
  }

  private move(from: State[], to: State[]): void {
    const state = from.pop();
    if (!state) return;
    to.push(this.state);
    const change = state.object === this.state.object && state.receiver === this.state.receiver && state.rig === this.state.rig;
    this.state = state;
    this.changed(change ? "follow" : "find");
  }

  private remember(state: State): void {
    this.past.push(state);
    if (this.past.length > UNDOABLE) this.past.shift();
    this.future = [];
  }
}
