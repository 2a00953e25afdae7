/** Regions of the object painted by a brush: forbidden, avoided or preferred triangles. */
import { Color, Raycaster, Vector2, Vector3 } from "three";

import { Preference } from "#contract/object_service_pb";
import type { App } from "./app";
import * as api from "./api";
import { button, choice, element, toast } from "./dom";
import { meshOf, SURFACE, type ObjectMesh } from "./object";
import { saveRegions } from "./own";

type Brush = "off" | "forbid" | "avoid" | "prefer" | "erase";

const PREFERENCES: Record<Exclude<Brush, "off" | "erase">, Preference> = {
  forbid: Preference.FORBIDDEN,
  avoid: Preference.AVOIDED,
  prefer: Preference.PREFERRED,
};

const COLORS: Partial<Record<Preference, Color>> = {
  [Preference.FORBIDDEN]: new Color("#b9463e"),
  [Preference.AVOIDED]: new Color("#d99a3c"),
  [Preference.PREFERRED]: new Color("#4f9d6b"),
};

export class Painter {
  readonly section = element("section", { id: "paint" });
  private brush: Brush = "off";
  private radius = 0.008;
  /** Preference by the number of a triangle in the file. */
  private painted = new Map<number, Preference>();
  private mesh: ObjectMesh | null = null;
  private isDown = false;
  private readonly save = button("Save", () => void this.store(), { class: "small", id: "save-regions" });

  constructor(private readonly app: App) {
    const size = element("input", { type: "range", min: "2", max: "40", value: "8", title: "Radius of the brush in mm" });
    size.addEventListener("input", () => (this.radius = Number(size.value) / 1000));
    const brushes: [Brush, string][] = [["off", "Off"], ["forbid", "Forbid"], ["avoid", "Avoid"], ["prefer", "Prefer"], ["erase", "Erase"]];
    this.section.append(
      element("h2", {}, "Paint regions", this.save),
      choice(brushes, "off", (brush) => {
        this.brush = brush;
        app.gizmos.select(null);
        app.stage.controls.enabled = true;
      }),
      element("label", { class: "row dim", style: "margin-top: 8px" }, "Brush", size),
    );
    this.save.disabled = true;
    const { canvas } = app.stage;
    canvas.addEventListener("pointerdown", (event) => {
      if (this.brush === "off" || event.button !== 0) return;
      this.isDown = this.stroke(event);
      app.stage.controls.enabled = !this.isDown;
    }, { capture: true });
    canvas.addEventListener("pointermove", (event) => this.isDown && this.stroke(event));
    addEventListener("pointerup", () => {
      if (this.isDown) app.stage.controls.enabled = true;
      this.isDown = false;
    });
    app.onObject.push(() => void this.load());
  }

  /** A click paints instead of selecting. */
  get isActive(): boolean {
    return this.brush !== "off";
  }

  /** Takes the regions that the object has. */
  private async load(): Promise<void> {
    const { object } = this.app;
    if (!object) return;
    this.mesh = await meshOf(object.name, object.etag);
    this.painted = new Map();
    for (const { preference, triangles } of object.regions.filter((region) => region.name.startsWith("painted-"))) {
      for (const triangle of triangles) this.painted.set(triangle, preference);
    }
    this.save.disabled = true;
    if (this.painted.size > 0) this.color();
  }

  /** Paints what the brush touches; false if it touches nothing. */
  private stroke(event: PointerEvent): boolean {
    const { mesh, app } = this;
    if (!mesh || this.brush === "off") return false;
    const { width, height, left, top } = app.stage.canvas.getBoundingClientRect();
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height), app.stage.camera);
    const [hit] = ray.intersectObject(app.view.object.mesh, false);
    if (!hit) return false;
    const at = app.view.object.mesh.worldToLocal(hit.point.clone());
    const { position, normal } = mesh.geometry.attributes;
    const facing = hit.face!.normal;
    const [middle, out, corner] = [new Vector3(), new Vector3(), new Vector3()];
    for (let triangle = 0; triangle < mesh.numbers.length; triangle++) {
      middle.set(0, 0, 0);
      for (let i = 0; i < 3; i++) middle.add(corner.fromBufferAttribute(position!, 3 * triangle + i));
      middle.divideScalar(3);
      const isUnder = triangle === hit.faceIndex || (middle.distanceTo(at) < this.radius && out.fromBufferAttribute(normal!, 3 * triangle).dot(facing) > 0);
      if (!isUnder) continue;
      const number = mesh.numbers[triangle]!;
      if (this.brush === "erase") this.painted.delete(number);
      else this.painted.set(number, PREFERENCES[this.brush]);
    }
    this.save.disabled = false;
    this.color();
    return true;
  }

  private color(): void {
    const { mesh } = this;
    if (!mesh) return;
    const color = mesh.geometry.attributes.color!;
    for (const [triangle, number] of mesh.numbers.entries()) {
      const preference = this.painted.get(number);
      const painted = preference === undefined ? SURFACE : COLORS[preference]!;
      for (let i = 0; i < 3; i++) color.setXYZ(3 * triangle + i, painted.r, painted.g, painted.b);
    }
    color.needsUpdate = true;
    this.app.stage.draw(false);
  }

  private async store(): Promise<void> {
    const regions = new Map<Preference, number[]>(Object.values(PREFERENCES).map((preference) => [preference, []]));
    for (const [triangle, preference] of this.painted) regions.get(preference)?.push(triangle);
    try {
      await saveRegions(this.app, regions);
      await this.load();
      toast("Saved");
      await this.app.find();
    } catch (error) {
      toast(api.inWords(error), "bad");
    }
  }
}
