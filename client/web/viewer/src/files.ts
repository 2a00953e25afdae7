/** Dropped files: objects, hands and characters, recordings. */
import type { GraspObject } from "#contract/object_service_pb";
import type { App } from "./app";
import * as api from "./api";
import { button, byId, dialog, element, select, toast } from "./dom";
import { handedness, type Side } from "./kinematics";
import { stateFor } from "./state";
import { objectName } from "./words";

const MESHES = /\.(obj|stl|ply|glb|gltf)$/i;
const HANDS = /\.(vrm|glb|gltf)$/i;

/** A name that the server accepts, and that is not taken. */
export function freeName(file: string, taken: string[]): string {
  const base = file.replace(/\.[a-z]+$/i, "").toLowerCase().replaceAll(/[^a-z0-9]+/g, "-").replace(/^[^a-z]+/, "").replace(/-+$/, "").slice(0, 50) || "own";
  for (let number = 1; ; number++) {
    const name = number === 1 ? base : `${base}-${number}`;
    if (!taken.includes(name)) return name;
  }
}

/** Units of files, by meters per unit. */
const UNITS: [string, string][] = [["1", "meters"], ["0.01", "centimeters"], ["0.001", "millimeters"], ["0.0254", "inches"]];

/** Hand and character files name bones of hands in their nodes. */
function looksLikeHand(file: string, bytes: Uint8Array): boolean {
  if (/\.vrm$/i.test(file)) return true;
  if (!/\.(glb|gltf)$/i.test(file)) return false;
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(12, true);
  const json = new TextDecoder().decode(/\.glb$/i.test(file) ? bytes.subarray(20, 20 + length) : bytes);
  return /"skins"/.test(json) && /(index|thumb|finger|hand)/i.test(json);
}

export class Files {
  private readonly input = element("input", { type: "file", accept: ".obj,.stl,.ply,.glb,.gltf,.vrm,.json,.jsonl" });

  constructor(
    private readonly app: App,
    private readonly playRecording: (name: string, text: string) => void,
  ) {
    this.input.addEventListener("change", () => {
      const [file] = this.input.files ?? [];
      if (file) void this.take(file);
      this.input.value = "";
    });
    const zone = byId("drop");
    let depth = 0;
    addEventListener("dragenter", (event) => {
      event.preventDefault();
      zone.hidden = ++depth === 0;
    });
    addEventListener("dragleave", () => (zone.hidden = --depth <= 0));
    addEventListener("dragover", (event) => event.preventDefault());
    addEventListener("drop", (event) => {
      event.preventDefault();
      depth = 0;
      zone.hidden = true;
      const [file] = event.dataTransfer?.files ?? [];
      if (file) void this.take(file);
    });
  }

  choose(): void {
    this.input.click();
  }

  async take(file: File): Promise<void> {
    if (/\.jsonl?$/i.test(file.name)) {
      this.playRecording(file.name, await file.text());
      return;
    }
    const bytes = new Uint8Array(await file.arrayBuffer());
    if (looksLikeHand(file.name, bytes)) this.askHand(file.name, bytes);
    else if (MESHES.test(file.name)) this.askObject(file.name, bytes);
    else toast(`${file.name} is neither an object (OBJ, STL, PLY, GLB), a hand (VRM, GLB) nor a recording (JSON)`, "bad");
  }

  private askObject(file: string, mesh: Uint8Array<ArrayBuffer>): void {
    const name = element("input", { type: "text", id: "new-name", value: freeName(file, this.app.objects.map((object) => objectName(object.name))) });
    const mass = element("input", { type: "number", id: "new-mass", min: "0.001", step: "0.01", value: "0.2" });
    const unit = select(UNITS, "1", () => undefined, { id: "new-unit" });
    const zUp = element("input", { type: "checkbox", id: "new-z-up" });
    const problem = element("p", { class: "dim", id: "new-problem" });
    dialog("New object", (close) => [
      element("div", { class: "fields" }, "Name", name, "Mass in kg", mass, "Unit of the file", unit, "+Z is up", zUp),
      problem,
      element(
        "div",
        { class: "row" },
        HANDS.test(file) && button("It is a hand", () => this.askHand(file, mesh)),
        element("span", { class: "grow" }),
        button("Cancel", close),
        button("Create", () => {
          problem.textContent = "Creating…";
          const object = { name: `objects/${name.value}`, massKg: Number(mass.value), zUp: zUp.checked, metersPerUnit: Number(unit.value) };
          api.objects.createObject({ object, mesh }).then(
            (created) => {
              close();
              void this.created(created);
            },
            (error: unknown) => (problem.textContent = api.inWords(error)),
          );
        }, { id: "create", "aria-pressed": "true" }),
      ),
    ]);
  }

  /** Shows what the server says about a new object, and a grasp of it. */
  private async created(object: GraspObject): Promise<void> {
    await this.app.refreshObjects();
    this.app.open(stateFor(object.name));
    this.report(object);
  }

  /** Oddities of an object; a wrong unit can be changed. */
  private report(object: GraspObject): void {
    const size = object.boundingBox?.halfExtents;
    const edges = size ? [size.x, size.y, size.z].map((half) => `${(200 * half).toPrecision(3)}`).join(" × ") : "?";
    const unit = String(UNITS.map(([value]) => Number(value)).find((value) => Math.abs(value / (object.metersPerUnit ?? 1) - 1) < 1e-5) ?? 1);
    const change = (metersPerUnit: string) => {
      const { name, etag } = object;
      const changed = { object: { name, etag, metersPerUnit: Number(metersPerUnit) }, updateMask: { paths: ["meters_per_unit"] } };
      api.objects.updateObject(changed).then((updated) => this.created(updated), (error: unknown) => toast(api.inWords(error), "bad"));
    };
    dialog(objectName(object.name), (close) => [
      element("p", {}, `${object.triangleCount} triangles, ${edges} cm, ${object.massKg.toPrecision(3)} kg`),
      object.warnings.length > 0
        ? element("ul", { class: "warnings", id: "object-warnings" }, ...object.warnings.map((line) => element("li", {}, line)))
        : element("p", { class: "dim" }, "Nothing is odd about this mesh."),
      element("div", { class: "fields" }, "Unit of the file", select(UNITS, unit, change, { id: "unit" })),
      element("div", { class: "row" }, button("Close", close, { id: "close" })),
    ]);
  }

  private askHand(file: string, model: Uint8Array<ArrayBuffer>): void {
    const name = element("input", { type: "text", id: "new-name", value: freeName(file, this.app.rigs.all.map((rig) => rig.name.replace("rigs/", ""))) });
    const side = element("select", { id: "new-side" }, ...[["", "as the file says"], ["left", "left"], ["right", "right"]].map(([value, text]) => element("option", { value }, text!)));
    const problem = element("p", { class: "dim", id: "new-problem" });
    dialog("New hand", (close) => [
      element("div", { class: "fields" }, "Name", name, "Hand", side),
      problem,
      element(
        "div",
        { class: "row" },
        MESHES.test(file) && button("It is an object", () => this.askObject(file, model)),
        element("span", { class: "grow" }),
        button("Cancel", close),
        button("Create", () => {
          problem.textContent = "Measuring the hand…";
          const request = { rigId: name.value, models: [model], ...(side.value && { handedness: handedness(side.value as Side) }) };
          api.rigs.createRig(request).then(
            async (rig) => {
              close();
              await this.app.models.add(rig.name, model.buffer);
              this.app.rigs.add(rig);
              const warned = rig.warnings.length > 0;
              if (warned) dialog(`${rig.name} was created`, (done) => [element("ul", { class: "warnings" }, ...rig.warnings.map((line) => element("li", {}, line))), element("div", { class: "row" }, button("Close", done))]);
              this.app.store.edit({ rig: rig.name }, "find");
            },
            (error: unknown) => (problem.textContent = api.inWords(error)),
          );
        }, { id: "create", "aria-pressed": "true" }),
      ),
    ]);
  }
}
