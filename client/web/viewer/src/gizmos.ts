/** Gizmos that move, turn and scale the object, the giver's hand, or both. */
import { type Matrix4, Object3D } from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";

import { matrix, poseOf } from "./poses";
import type { Stage } from "./stage";
import type { State, Store } from "./state";

export type Target = "object" | "giver" | "both";
export type Mode = "translate" | "rotate" | "scale";

const SCALES = { object: [0.25, 4], giver: [0.5, 2] } as const;
const hundredths = (value: number) => Math.round(100 * value) / 100;

export class Gizmos {
  readonly controls: TransformControls;
  private readonly handle = new Object3D();
  private target: Target | null = null;
  private start: { state: State; handle: Matrix4 } | null = null;

  constructor(
    private readonly stage: Stage,
    private readonly store: () => Store,
    private readonly changed: () => void,
  ) {
    this.controls = new TransformControls(stage.camera, stage.canvas);
    this.controls.setSize(0.62);
    this.controls.setSpace("world");
    stage.scene.add(this.handle, this.controls.getHelper());
    this.controls.addEventListener("change", () => stage.draw(false));
    this.controls.addEventListener("dragging-changed", ({ value }) => {
      stage.controls.enabled = !value;
      if (value) {
        this.handle.updateMatrix();
        this.start = { state: this.store().state, handle: this.handle.matrix.clone() };
      } else {
        this.start = null;
        this.store().end();
        this.place();
        this.changed();
      }
    });
    this.controls.addEventListener("objectChange", () => this.drag());
  }

  get selected(): Target | null {
    return this.target;
  }

  get mode(): Mode {
    return this.controls.mode as Mode;
  }

  select(target: Target | null): void {
    this.target = target !== "object" && !this.store().state.giver ? (target && "object") : target;
    if (this.target === "both" && this.mode === "scale") this.controls.setMode("translate");
    if (this.target) this.controls.attach(this.handle);
    else this.controls.detach();
    this.place();
    this.changed();
  }

  use(mode: Mode): void {
    if (this.target === "both" && mode === "scale") this.target = "object";
    if (!this.target) this.select("object");
    this.controls.setMode(mode);
    this.controls.setSpace(mode === "translate" ? "world" : "local");
    this.place();
    this.changed();
  }

  /** Puts the gizmo where its target is. */
  place(): void {
    if (this.start || !this.target) return;
    const { state } = this.store();
    const pose = this.target === "giver" && state.giver ? state.giver.wrist : state.pose;
    this.handle.position.set(...pose.p);
    this.handle.quaternion.set(...pose.q);
    this.handle.scale.setScalar(1);
    this.stage.draw(false);
  }

  private drag(): void {
    if (!this.start || !this.target) return;
    const { state, handle } = this.start;
    this.handle.updateMatrix();
    const store = this.store();
    if (this.mode === "scale") {
      const { x, y, z } = this.handle.scale;
      const factor = [x, y, z].reduce((a, b) => (Math.abs(b - 1) > Math.abs(a - 1) ? b : a));
      const of = (target: keyof typeof SCALES, scale: number) =>
        hundredths(Math.min(Math.max(Math.abs(scale * factor), SCALES[target][0]), SCALES[target][1]));
      if (this.target === "giver" && state.giver) store.drag({ giver: { ...state.giver, scale: of("giver", state.giver.scale) } });
      else store.drag({ scale: of("object", state.scale) });
      return;
    }
    const moved = this.handle.matrix.clone().multiply(handle.clone().invert());
    const move = (pose: State["pose"]) => poseOf(moved.clone().multiply(matrix(pose)));
    store.drag({
      ...(this.target === "giver" ? {} : { pose: move(state.pose) }),
      ...(this.target !== "object" && state.giver && { giver: { ...state.giver, wrist: move(state.giver.wrist) } }),
    });
  }
}
