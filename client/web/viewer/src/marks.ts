/** Marks on a grasp: contacts, force arrows, and the clearance between the two hands. */
import {
  BufferGeometry,
  CanvasTexture,
  Color,
  ConeGeometry,
  CylinderGeometry,
  Group,
  InstancedMesh,
  Line,
  LineDashedMaterial,
  type Matrix4,
  Matrix4 as Matrix,
  MeshBasicMaterial,
  Quaternion,
  SphereGeometry,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
  Vector3,
} from "three";

import type { Grasp } from "#contract/grasp_pb";
import { FIRST_OF_DIGIT, TIP_OF_DIGIT, WRIST } from "./kinematics";
import { vector } from "./poses";

/** Length of the arrow of the largest force, and of the shortest arrow, in meters. */
const LONGEST = 0.05;
const SHORTEST = 0.006;
const MOST = 64;

const DOT = new Color("#ffd166");
const FORCE = new Color("#ff7a59");

/** A hand's joints, and the distances from them to the skin. */
export interface Bones {
  joints: (Matrix4 | null)[];
  radii: number[];
}

/** The segments of a hand: start, end and their joints' radii. */
function segments({ joints, radii }: Bones): [Vector3, Vector3, number, number][] {
  const at = (joint: number) => joints[joint] && new Vector3().setFromMatrixPosition(joints[joint]);
  const pairs: [number, number][] = [];
  for (const [digit, first] of FIRST_OF_DIGIT.entries()) {
    pairs.push([WRIST, first]);
    for (let joint = first; joint < TIP_OF_DIGIT[digit]!; joint++) pairs.push([joint, joint + 1]);
  }
  return pairs.flatMap(([a, b]) => {
    const [from, to] = [at(a), at(b)];
    if (!from || !to) return [];
    // A tip lies on the skin: its ball ends there.
    if (TIP_OF_DIGIT.includes(b)) to.addScaledVector(from.clone().sub(to).normalize(), Math.min(radii[b]!, from.distanceTo(to)));
    return [[from, to, radii[a]!, radii[b]!] as [Vector3, Vector3, number, number]];
  });
}

/** The nearest points of two hands' skins. */
export function nearest(a: Bones, b: Bones): [Vector3, Vector3] | null {
  let [best, found]: [number, [Vector3, Vector3] | null] = [Infinity, null];
  const of = (ends: [Vector3, Vector3, number, number], t: number) => ends[0].clone().lerp(ends[1], t);
  const others = segments(b);
  for (const one of segments(a)) {
    for (const other of others) {
      for (let i = 0; i <= 6; i++) {
        const p = of(one, i / 6);
        const along = other[1].clone().sub(other[0]);
        const t = Math.min(Math.max(p.clone().sub(other[0]).dot(along) / Math.max(along.lengthSq(), 1e-9), 0), 1);
        const q = of(other, t);
        const [r, s] = [one[2] + ((one[3] - one[2]) * i) / 6, other[2] + (other[3] - other[2]) * t];
        const gap = p.distanceTo(q) - r - s;
        if (gap < best) {
          const way = q.clone().sub(p).normalize();
          [best, found] = [gap, [p.clone().addScaledVector(way, r), q.clone().addScaledVector(way, -s)]];
        }
      }
    }
  }
  return found;
}

export class Marks {
  /** In the object's frame. */
  readonly atObject = new Group();
  /** In the client's frame. */
  readonly between = new Group();
  private readonly dots: InstancedMesh;
  private readonly shafts: InstancedMesh;
  private readonly heads: InstancedMesh;
  private readonly line: Line;
  private readonly label: Sprite;
  private labelled = "";

  constructor() {
    const front = { depthTest: false, transparent: true, toneMapped: false };
    const dot = new MeshBasicMaterial({ color: DOT, ...front, opacity: 0.95 });
    const force = new MeshBasicMaterial({ color: FORCE, ...front, opacity: 0.9 });
    this.dots = new InstancedMesh(new SphereGeometry(0.0026, 14, 10), dot, MOST);
    this.shafts = new InstancedMesh(new CylinderGeometry(0.001, 0.001, 1, 10).translate(0, 0.5, 0), force, MOST);
    this.heads = new InstancedMesh(new ConeGeometry(0.0028, 0.008, 14).translate(0, -0.004, 0), force, MOST);
    for (const [order, mesh] of [this.shafts, this.heads, this.dots].entries()) {
      mesh.frustumCulled = false;
      mesh.renderOrder = 10 + order;
      mesh.count = 0;
      this.atObject.add(mesh);
    }
    this.atObject.name = "contacts";
    const dashes = new LineDashedMaterial({ color: "#7fd4ff", dashSize: 0.004, gapSize: 0.0025, ...front });
    this.line = new Line(new BufferGeometry(), dashes);
    this.label = new Sprite(new SpriteMaterial({ ...front }));
    this.line.renderOrder = this.label.renderOrder = 13;
    this.line.frustumCulled = false;
    this.between.name = "clearance";
    this.between.add(this.line, this.label);
    this.between.visible = false;
  }

  /** Shows the contacts and forces of a grasp. */
  show(grasp: Grasp | null): void {
    const contacts = (grasp?.contacts ?? []).slice(0, MOST);
    const largest = Math.max(...contacts.map((contact) => vector(contact.force).length()), 1e-3);
    let arrows = 0;
    for (const [index, contact] of contacts.entries()) {
      const [at, force] = [vector(contact.position), vector(contact.force)];
      this.dots.setMatrixAt(index, new Matrix().makeTranslation(at));
      if (force.length() < 1e-4) continue;
      const length = Math.max((LONGEST * force.length()) / largest, SHORTEST);
      const turn = new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), force.clone().normalize());
      // The arrow ends at the contact, on which the hand presses.
      const start = at.clone().addScaledVector(force.clone().normalize(), -length);
      this.shafts.setMatrixAt(arrows, new Matrix().compose(start, turn, new Vector3(1, Math.max(length - 0.006, 0.001), 1)));
      this.heads.setMatrixAt(arrows, new Matrix().compose(at, turn, new Vector3(1, 1, 1)));
      arrows++;
    }
    this.dots.count = contacts.length;
    this.shafts.count = this.heads.count = arrows;
    for (const mesh of [this.dots, this.shafts, this.heads]) mesh.instanceMatrix.needsUpdate = true;
  }

  /** Shows the distance between two hands: where it is, and how much the server measured, in meters. */
  clearance(ends: [Vector3, Vector3] | null, meters: number | undefined): void {
    this.between.visible = ends !== null && meters !== undefined;
    if (!ends || meters === undefined) return;
    this.line.geometry.setFromPoints(ends);
    this.line.computeLineDistances();
    this.label.position.copy(ends[0]).lerp(ends[1], 0.5).add(new Vector3(0, 0.012, 0));
    this.write(`${(1000 * meters).toFixed(meters < 0.01 ? 1 : 0)} mm`);
  }

  private write(text: string): void {
    if (text === this.labelled) return;
    this.labelled = text;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [256, 80];
    const context = canvas.getContext("2d")!;
    context.font = "600 44px system-ui, sans-serif";
    context.textAlign = "center";
    const width = context.measureText(text).width + 44;
    context.fillStyle = "rgba(14, 20, 28, 0.82)";
    context.beginPath();
    context.roundRect(128 - width / 2, 6, width, 68, 34);
    context.fill();
    context.fillStyle = "#a9e2ff";
    context.fillText(text, 128, 56);
    this.label.material.map?.dispose();
    this.label.material.map = new CanvasTexture(canvas);
    this.label.material.map.colorSpace = SRGBColorSpace;
    this.label.material.needsUpdate = true;
    this.label.scale.set(0.058, 0.058 * (80 / 256), 1);
  }
}
