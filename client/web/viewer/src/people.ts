/** Mannequins of giver and receiver: a body on the ground, and the arm that leads to the hand. */
import {
  BufferGeometry,
  Color,
  Float32BufferAttribute,
  Group,
  LatheGeometry,
  type Matrix4,
  Mesh,
  MeshStandardMaterial,
  Quaternion,
  SphereGeometry,
  Vector2,
  Vector3,
} from "three";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";

import type { Looks } from "./hands";
import type { Side } from "./kinematics";

/** Lengths of the arm and breadth of the shoulders for a height of 1.75 m (Drillis and Contini, 1966), in meters. */
const UPPER_ARM = 0.3;
const FOREARM = 0.26;
const SHOULDER = { height: 1.42, side: 0.185 };

/** Where a giver's shoulder is from the wrist, seen by the giver: to the side and back, in meters. */
const GIVEN_FROM = new Vector3(0.03, 0, -0.36);

/** A body turned from side to side: rings of half breadth, height, half depth and forward shift. */
type Ring = [breadth: number, height: number, depth: number, forward?: number];

function loft(rings: Ring[], color: Color, center = new Vector3()): BufferGeometry {
  const around = 28;
  const [positions, indices]: [number[], number[]] = [[], []];
  // Rounded between the rings.
  const steps = 5;
  const at = (index: number) => rings[Math.min(Math.max(index, 0), rings.length - 1)]!;
  const smooth: number[][] = [];
  for (let ring = 0; ring < rings.length - 1; ring++) {
    for (let step = 0; step < (ring === rings.length - 2 ? steps + 1 : steps); step++) {
      const t = step / steps;
      smooth.push(
        [0, 1, 2, 3].map((i) => {
          const [a, b, c, d] = [at(ring - 1)[i] ?? 0, at(ring)[i] ?? 0, at(ring + 1)[i] ?? 0, at(ring + 2)[i] ?? 0];
          const value = 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t * t + (3 * b - a - 3 * c + d) * t ** 3);
          return i === 0 || i === 2 ? Math.max(value, 0) : value;
        }),
      );
    }
  }
  for (const [breadth, height, depth, forward] of smooth as [number, number, number, number][]) {
    for (let i = 0; i <= around; i++) {
      const angle = (2 * Math.PI * i) / around;
      positions.push(
        center.x + breadth * Math.sin(angle),
        center.y + height,
        center.z + forward + depth * Math.cos(angle),
      );
    }
  }
  for (let ring = 0; ring < smooth.length - 1; ring++) {
    for (let i = 0; i < around; i++) {
      const a = ring * (around + 1) + i;
      indices.push(a, a + 1, a + around + 1, a + 1, a + around + 2, a + around + 1);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(positions, 3));
  geometry.setIndex(indices);
  geometry.computeVertexNormals();
  return colored(geometry, color);
}

/** A ball at each end of a line, and what lies between. */
function limb(from: Vector3, to: Vector3, start: number, end: number, color: Color): BufferGeometry {
  return colored(capsule(from.distanceTo(to), start, end).applyQuaternion(turnTo(from, to)).translate(...from.toArray()), color);
}

function capsule(length: number, start: number, end: number): BufferGeometry {
  const tilt = Math.asin(Math.min(Math.max((start - end) / Math.max(length, 1e-6), -1), 1));
  const profile: Vector2[] = [];
  for (let i = 0; i <= 8; i++) {
    const angle = -Math.PI / 2 + ((Math.PI / 2 + tilt) * i) / 8;
    profile.push(new Vector2(start * Math.cos(angle), start * Math.sin(angle)));
  }
  for (let i = 0; i <= 8; i++) {
    const angle = tilt + ((Math.PI / 2 - tilt) * i) / 8;
    profile.push(new Vector2(end * Math.cos(angle), length + end * Math.sin(angle)));
  }
  return new LatheGeometry(profile, 24);
}

function turnTo(from: Vector3, to: Vector3): Quaternion {
  return new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), to.clone().sub(from).normalize());
}

function ball(at: Vector3, radii: Vector3, color: Color): BufferGeometry {
  return colored(new SphereGeometry(1, 28, 20).scale(...radii.toArray()).translate(...at.toArray()), color);
}

function colored(geometry: BufferGeometry, color: Color): BufferGeometry {
  const count = geometry.attributes.position!.count;
  const colors = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) color.toArray(colors, 3 * i);
  geometry.setAttribute("color", new Float32BufferAttribute(colors, 3));
  geometry.deleteAttribute("uv");
  return geometry;
}

/** The body without the arm of `side`; origin between the feet, facing +Z, so that the right is at -X. */
function body(looks: Looks, side: Side): BufferGeometry {
  const [skin, cloth, trousers, hair] = [looks.skin[0], looks.sleeve, looks.trousers, looks.hair].map((c) => new Color(c)) as [
    Color,
    Color,
    Color,
    Color,
  ];
  const shoes = new Color("rgb(40, 40, 44)");
  const parts = [
    loft([[0, 0.9, 0, 0], [0.165, 0.9, 0.118, 0], [0.162, 0.96, 0.116, 0], [0.143, 1.1, 0.1, 0.005], [0.168, 1.28, 0.122, 0.008], [0.178, 1.37, 0.112, 0], [0.135, 1.445, 0.085, -0.008], [0.064, 1.48, 0.064, -0.008], [0.05, 1.483, 0.05, -0.008]], cloth),
    loft([[0.056, 1.45, 0.058, -0.01], [0.052, 1.5, 0.055, -0.004], [0.052, 1.56, 0.056, 0.004]], skin),
    loft([[0, 0.84, 0], [0.155, 0.85, 0.112], [0.164, 0.92, 0.117]], trousers),
    ball(new Vector3(0, 1.645, 0.018), new Vector3(0.076, 0.112, 0.094), skin),
    ball(new Vector3(0, 1.672, 0.0), new Vector3(0.081, 0.1, 0.096), hair),
    ball(new Vector3(0, 1.63, 0.11), new Vector3(0.013, 0.022, 0.014), skin),
  ];
  for (const sign of [-1, 1]) {
    const [hip, knee, ankle] = [new Vector3(sign * 0.09, 0.88, 0), new Vector3(sign * 0.1, 0.48, 0.008), new Vector3(sign * 0.105, 0.09, -0.01)];
    parts.push(
      limb(hip, knee, 0.082, 0.058, trousers),
      limb(knee, ankle, 0.058, 0.044, trousers),
      ball(new Vector3(sign * 0.108, 0.04, 0.035), new Vector3(0.04, 0.04, 0.108), shoes),
      ball(new Vector3(sign * SHOULDER.side, SHOULDER.height, -0.005), new Vector3(0.062, 0.06, 0.062), cloth),
    );
  }
  // The other arm hangs.
  const sign = side === "right" ? 1 : -1;
  const [shoulder, elbow, wrist] = [
    new Vector3(sign * SHOULDER.side, SHOULDER.height, -0.005),
    new Vector3(sign * 0.235, 1.13, -0.03),
    new Vector3(sign * 0.235, 0.885, 0.05),
  ];
  parts.push(
    limb(shoulder, elbow, 0.058, 0.047, cloth),
    limb(elbow, wrist, 0.047, 0.036, cloth),
    ball(new Vector3(sign * 0.233, 0.81, 0.075), new Vector3(0.021, 0.078, 0.042), skin),
  );
  const merged = mergeGeometries(parts.map((part) => (part.index ? part.toNonIndexed() : part)));
  for (const part of parts) part.dispose();
  return merged;
}

/** A sleeve along +Z from the wrist, a meter long, with a cuff: distance from the axis, and place. */
const CUFF: [number, number][] = [
  [0.001, 0.016],
  [0.0265, 0.016],
  [0.0265, 0.007],
  [0.0285, 0.006],
  [0.031, 0.007],
  [0.0313, 0.026],
  [0.0295, 0.0275],
];
const AT_WRIST = 0.029;
const AT_ELBOW = 0.041;
const AT_SHOULDER = 0.052;

/** A person with one posed arm. */
export class Person {
  readonly group = new Group();
  private readonly material = new MeshStandardMaterial({ vertexColors: true, roughness: 0.86 });
  private readonly bodies: Record<Side, Mesh | null> = { left: null, right: null };
  private readonly arm = new Mesh(new BufferGeometry(), this.material);
  private side: Side = "right";
  /** Faces +Z of the client's frame, or -Z. */
  private root: Vector3 | null = null;
  elbow: Vector3 | null = null;
  private shoulder: Vector3 | null = null;
  /** Between the feet. */
  standsAt: Vector3 | null = null;

  constructor(
    readonly name: string,
    private readonly looks: Looks,
    private readonly facing: 1 | -1,
    private readonly groundY: () => number,
  ) {
    this.group.name = name;
    this.arm.name = `${name}-arm`;
    this.arm.castShadow = this.arm.receiveShadow = true;
    this.arm.frustumCulled = false;
    this.group.add(this.arm);
  }

  /** Forgets where the person is, to come to the next hand anew. */
  leave(): void {
    this.root = null;
  }

  /** Puts the person so that the arm reaches the wrist, as near as possible to where they are, and bends the arm. */
  reach(side: Side, wrist: Matrix4): void {
    this.side = side;
    const at = new Vector3().setFromMatrixPosition(wrist);
    const out = side === "right" ? -1 : 1;
    const root = this.root ?? this.rootOf(at.clone().add(new Vector3(GIVEN_FROM.x * out, 0, GIVEN_FROM.z).multiplyScalar(this.facing)));
    const shoulder = this.shoulderOf(root);
    // Steps nearer or back.
    const away = at.clone().sub(shoulder);
    const [flat, drop] = [Math.hypot(away.x, away.z), Math.abs(away.y)];
    const [near, far] = [0.24, 0.53].map((reach) => Math.sqrt(Math.max(reach ** 2 - drop ** 2, 0.01)));
    const wanted = Math.min(Math.max(flat, near!), far!);
    if (flat > 1e-4) {
      const step = (flat - wanted) / flat;
      root.x += away.x * step;
      root.z += away.z * step;
    }
    this.root = root;
    const from = this.shoulderOf(root);
    this.shoulder = from;
    this.bend(from, this.elbowOf(from, at, new Vector3().setFromMatrixColumn(wrist, 2)), wrist);
    this.stand(root, from);
  }

  /** Puts the person behind a given elbow: upright, and no nearer than the upper arm wants. */
  follow(side: Side, wrist: Matrix4, elbow: Vector3): void {
    this.side = side;
    const wanted = this.groundY() + SHOULDER.height - elbow.y;
    const rise = Math.min(Math.max(wanted, -0.8 * UPPER_ARM), 0.93 * UPPER_ARM);
    // Taller or shorter than people are: the arm is bent otherwise.
    if (Math.abs(rise - wanted) > 0.14) {
      this.leave();
      this.reach(side, wrist);
      return;
    }
    const out = (side === "right" ? -1 : 1) * this.facing;
    const back = new Vector3(-0.5 * out, 0, -this.facing).normalize().multiplyScalar(Math.sqrt(UPPER_ARM ** 2 - rise ** 2));
    const shoulder = elbow.clone().add(back).add(new Vector3(0, rise, 0));
    this.shoulder = shoulder;
    this.bend(shoulder, elbow, wrist);
    this.stand(this.rootOf(shoulder), shoulder);
  }

  /** Bends the arm from the shoulder, which stays where it is. */
  bendTo(wrist: Matrix4): void {
    if (!this.shoulder) return;
    const at = new Vector3().setFromMatrixPosition(wrist);
    this.bend(this.shoulder, this.elbowOf(this.shoulder, at, new Vector3().setFromMatrixColumn(wrist, 2)), wrist);
  }

  private rootOf(shoulder: Vector3): Vector3 {
    const out = (this.side === "right" ? -1 : 1) * this.facing;
    return new Vector3(shoulder.x - out * SHOULDER.side, this.groundY(), shoulder.z);
  }

  private shoulderOf(root: Vector3): Vector3 {
    const out = (this.side === "right" ? -1 : 1) * this.facing;
    return new Vector3(root.x + out * SHOULDER.side, this.groundY() + SHOULDER.height, root.z);
  }

  private elbowOf(shoulder: Vector3, wrist: Vector3, forearm: Vector3): Vector3 {
    const along = wrist.clone().sub(shoulder);
    const reach = Math.min(along.length(), UPPER_ARM + FOREARM - 1e-3);
    along.normalize();
    const before = (UPPER_ARM ** 2 - FOREARM ** 2 + reach ** 2) / (2 * reach);
    const off = Math.sqrt(Math.max(UPPER_ARM ** 2 - before ** 2, 0));
    // As near to the hand's own forearm as the arm allows, and rather below.
    const out = (this.side === "right" ? -1 : 1) * this.facing;
    const pole = wrist.clone().addScaledVector(forearm, FOREARM).sub(shoulder).add(new Vector3(0.05 * out, -0.16, 0));
    pole.addScaledVector(along, -pole.dot(along)).normalize();
    return shoulder.clone().addScaledVector(along, before).addScaledVector(pole, off);
  }

  private bend(shoulder: Vector3, elbow: Vector3, wrist: Matrix4): void {
    this.elbow = elbow;
    const cloth = new Color(this.looks.sleeve);
    const at = new Vector3().setFromMatrixPosition(wrist);
    const length = at.distanceTo(elbow);
    const profile = [...CUFF.map(([r, z]) => new Vector2(r, z)), new Vector2((AT_WRIST + AT_ELBOW) / 2 + 0.001, length * 0.6), new Vector2(AT_ELBOW, length), new Vector2(AT_ELBOW * 0.8, length + 0.02), new Vector2(0.001, length + 0.034)];
    const sleeve = new LatheGeometry(profile, 28).rotateX(Math.PI / 2);
    // The wrist is broader than it is thick.
    const position = sleeve.attributes.position!;
    for (let i = 0; i < position.count; i++) {
      const share = 1 - Math.min(position.getZ(i) / length, 1);
      position.setXY(i, position.getX(i) * (1 + 0.16 * share), position.getY(i) * (1 - 0.08 * share));
    }
    const own = new Vector3().setFromMatrixColumn(wrist, 2).normalize();
    const turn = new Quaternion().setFromUnitVectors(own, elbow.clone().sub(at).normalize());
    sleeve.applyQuaternion(turn.multiply(new Quaternion().setFromRotationMatrix(wrist))).translate(...at.toArray());
    sleeve.computeVertexNormals();
    this.arm.geometry.dispose();
    const upper = limb(elbow, shoulder, AT_ELBOW, AT_SHOULDER, cloth);
    this.arm.geometry = mergeGeometries([colored(sleeve, cloth), upper]);
  }

  private stand(root: Vector3, shoulder: Vector3): void {
    for (const side of ["left", "right"] as const) {
      const mesh = this.bodies[side];
      if (mesh) mesh.visible = side === this.side;
    }
    let mesh = this.bodies[this.side];
    if (!mesh) {
      mesh = new Mesh(body(this.looks, this.side), this.material);
      mesh.name = `${this.name}-body`;
      mesh.castShadow = mesh.receiveShadow = true;
      this.bodies[this.side] = mesh;
      this.group.add(mesh);
    }
    // As tall as the shoulder is high.
    const height = (shoulder.y - this.groundY()) / SHOULDER.height;
    mesh.scale.setScalar(Math.min(Math.max(height, 0.75), 1.2));
    mesh.position.set(root.x, this.groundY(), root.z);
    this.standsAt = mesh.position;
    mesh.rotation.y = this.facing === 1 ? 0 : Math.PI;
  }
}
