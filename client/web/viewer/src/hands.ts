/** Hands with skin. The skins of the built-in rigs are stretched to the bones and widths of other rigs. */
import {
  Bone,
  BufferGeometry,
  Color,
  Float32BufferAttribute,
  Group,
  Matrix4,
  MeshPhysicalMaterial,
  Quaternion,
  Skeleton,
  SkinnedMesh,
  Uint16BufferAttribute,
  Vector3,
} from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

import adultLeft from "#hands/adult_left.glb";
import adultRight from "#hands/adult_right.glb";
import thesisLeft from "#hands/thesis_left.glb";
import thesisRight from "#hands/thesis_right.glb";
import { FIRST_OF_DIGIT, type HandRigSide, JOINTS, type Side, TIP_OF_DIGIT, WRIST } from "./kinematics";

const FILES: Record<string, Record<Side, Uint8Array<ArrayBuffer>>> = {
  "rigs/adult": { left: adultLeft, right: adultRight },
  "rigs/thesis": { left: thesisLeft, right: thesisRight },
};

/** How a person looks: back of the hand, palm, and flushed knuckles and tips; sleeves, trousers and hair. */
export interface Looks {
  skin: [string, string, string];
  sleeve: string;
  trousers: string;
  hair: string;
}

export const GIVER: Looks = {
  skin: ["rgb(224, 178, 152)", "rgb(230, 180, 158)", "rgb(214, 146, 124)"],
  sleeve: "rgb(92, 118, 158)",
  trousers: "rgb(52, 58, 70)",
  hair: "rgb(92, 68, 50)",
};

export const RECEIVER: Looks = {
  skin: ["rgb(138, 92, 68)", "rgb(186, 136, 108)", "rgb(122, 74, 54)"],
  sleeve: "rgb(116, 150, 122)",
  trousers: "rgb(58, 54, 60)",
  hair: "rgb(34, 28, 26)",
};

/** The bone that the skin behind the wrist follows. */
const FOREARM = 25;

/** Skin within this distance of the wrist along the arm bends with it, in meters. */
const WRIST_BAND = 0.012;

/** A built-in skin: its geometry, and the joints that it is bound to. */
interface Skin {
  geometry: BufferGeometry;
  /** Per bone, OpenXR's joints but the palm. */
  bindInverses: Matrix4[];
  rig: HandRigSide;
}

const smoothstep = (from: number, to: number, value: number) => {
  const t = Math.min(Math.max((value - from) / (to - from), 0), 1);
  return t * t * (3 - 2 * t);
};

const skins = new Map<string, Promise<Skin>>();

function skinOf(rig: HandRigSide): Promise<Skin> {
  const key = `${rig.rig}/${rig.side}`;
  let skin = skins.get(key);
  if (!skin) {
    skin = loadSkin(FILES[rig.rig]![rig.side], rig);
    skins.set(key, skin);
  }
  return skin;
}

async function loadSkin(file: Uint8Array<ArrayBuffer>, rig: HandRigSide): Promise<Skin> {
  const bytes = file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength);
  const gltf = await new GLTFLoader().parseAsync(bytes, "");
  let mesh: SkinnedMesh | undefined;
  gltf.scene.traverse((node) => {
    if (node instanceof SkinnedMesh) mesh = node;
  });
  if (!mesh) throw new Error(`the hand of ${rig.rig} has no skin`);
  const geometry = mesh.geometry;
  splitAtWrist(geometry);
  return { geometry, bindInverses: mesh.skeleton.boneInverses.map((inverse) => inverse.clone()), rig };
}

/** Gives the skin behind the wrist to the forearm's bone. */
function splitAtWrist(geometry: BufferGeometry): void {
  const { position, skinIndex, skinWeight } = geometry.attributes as Record<string, Float32BufferAttribute>;
  const indices = new Uint16Array(4 * position!.count);
  for (let vertex = 0; vertex < position!.count; vertex++) {
    const bones = [0, 1, 2, 3].map((slot) => skinIndex!.getComponent(vertex, slot));
    const weights = [0, 1, 2, 3].map((slot) => skinWeight!.getComponent(vertex, slot));
    const isNear = Math.hypot(position!.getX(vertex), position!.getY(vertex)) < 0.055;
    const share = isNear ? smoothstep(-WRIST_BAND, WRIST_BAND, position!.getZ(vertex)) : 0;
    if (share > 0) {
      const spare = weights.indexOf(Math.min(...weights));
      weights[spare] = 0;
      const rest = weights.reduce((a, b) => a + b, 0);
      for (const slot of weights.keys()) weights[slot]! *= (1 - share) / rest;
      [bones[spare], weights[spare]] = [FOREARM, share];
    }
    indices.set(bones, 4 * vertex);
    skinWeight!.setXYZW(vertex, weights[0]!, weights[1]!, weights[2]!, weights[3]!);
  }
  geometry.setAttribute("skinIndex", new Uint16BufferAttribute(indices, 4));
}

/** The skin's colors: paler in the palm, flushed at knuckles and tips. */
function paint({ geometry, bindInverses, rig }: Skin, looks: Looks): Float32BufferAttribute {
  const [back, palm, flush] = looks.skin.map((color) => new Color(color)) as [Color, Color, Color];
  const { position, normal, skinIndex, skinWeight } = geometry.attributes;
  const backs = bindInverses.map((inverse) => new Vector3().setFromMatrixColumn(inverse.clone().invert(), 1));
  const joints = bindInverses.map((inverse) => new Vector3().setFromMatrixPosition(inverse.clone().invert()));
  const [at, out, color] = [new Vector3(), new Vector3(), new Color()];
  const colors = new Float32Array(3 * position!.count);
  for (let vertex = 0; vertex < position!.count; vertex++) {
    at.fromBufferAttribute(position!, vertex);
    out.fromBufferAttribute(normal!, vertex);
    let palmar = 0;
    for (let slot = 0; slot < 4; slot++) {
      const bone = skinIndex!.getComponent(vertex, slot);
      palmar -= skinWeight!.getComponent(vertex, slot) * out.dot(backs[bone === FOREARM ? 0 : bone]!);
    }
    let flushed = 0;
    for (const [digit, tip] of TIP_OF_DIGIT.entries()) {
      for (let joint = FIRST_OF_DIGIT[digit]! + 1; joint <= tip; joint++) {
        const distance = at.distanceTo(joints[joint - 1]!);
        const near = 1 - smoothstep(0.5, 1.45, distance / Math.max(rig.radii[joint]!, 1e-3));
        const most = joint === tip ? 0.45 : 0.55 * smoothstep(0.1, 0.8, -palmar);
        flushed = Math.max(flushed, near * most);
      }
    }
    color.copy(back).lerp(palm, smoothstep(-0.15, 0.55, palmar)).lerp(flush, flushed).toArray(colors, 3 * vertex);
  }
  return new Float32BufferAttribute(colors, 3);
}

/** A person's hand on the stage. */
export class Hand {
  readonly group = new Group();
  readonly material: MeshPhysicalMaterial;
  /** Half widths of the wrist, in meters, for sleeves. */
  private readonly skeletons = new Map<Skin, { mesh: SkinnedMesh; bones: Bone[] }>();
  private shown: SkinnedMesh | null = null;
  /** The last joints, in the client's frame. */
  joints: (Matrix4 | null)[] = [];
  radii: number[] = [];

  constructor(
    readonly name: string,
    private readonly looks: Looks,
    private readonly adult: (side: Side) => HandRigSide,
  ) {
    this.group.name = name;
    this.material = new MeshPhysicalMaterial({
      vertexColors: true,
      roughness: 0.58,
      sheen: 0.45,
      sheenRoughness: 0.55,
      sheenColor: new Color(looks.skin[2]),
    });
  }

  /** Shows the hand with joints in the client's frame; the forearm comes from `elbow`. */
  async pose(rig: HandRigSide, joints: (Matrix4 | null)[], scale: number, elbow: Vector3 | null): Promise<void> {
    this.joints = joints;
    this.radii = rig.radii.map((radius) => radius * scale);
    const isBuiltIn = rig.rig in FILES;
    const skin = await skinOf(isBuiltIn ? rig : this.adult(rig.side));
    const { mesh, bones } = this.meshOf(skin);
    if (this.shown !== mesh) {
      this.group.clear();
      this.group.add(mesh);
      this.shown = mesh;
    }
    const scales = isBuiltIn ? null : stretches(skin.rig, rig);
    for (let joint = WRIST; joint < JOINTS; joint++) {
      const at = joints[joint] ?? joints[WRIST]!;
      const bone = bones[joint - 1]!;
      bone.matrix.copy(at).scale(scales?.[joint]?.clone().multiplyScalar(scale) ?? new Vector3(scale, scale, scale));
      bone.matrixWorldNeedsUpdate = true;
    }
    const wrist = joints[WRIST]!;
    const forearm = bones[FOREARM]!;
    forearm.matrix.copy(wrist).scale(new Vector3(scale, scale, scale));
    if (elbow) {
      const at = new Vector3().setFromMatrixPosition(wrist);
      const own = new Vector3().setFromMatrixColumn(wrist, 2).normalize();
      const turn = new Quaternion().setFromUnitVectors(own, elbow.clone().sub(at).normalize());
      const bend = new Matrix4().makeTranslation(at).multiply(new Matrix4().makeRotationFromQuaternion(turn));
      forearm.matrix.premultiply(bend.multiply(new Matrix4().makeTranslation(at.negate())));
    }
    forearm.matrixWorldNeedsUpdate = true;
    this.group.visible = true;
  }

  /** Fades the hand, as that of a grasp that is no longer valid. */
  fade(isFaded: boolean): void {
    if (this.material.transparent === isFaded) return;
    this.material.transparent = isFaded;
    this.material.opacity = isFaded ? 0.32 : 1;
    this.material.needsUpdate = true;
  }

  get mesh(): SkinnedMesh | null {
    return this.shown;
  }

  private meshOf(skin: Skin) {
    let made = this.skeletons.get(skin);
    if (!made) {
      const geometry = skin.geometry.clone();
      geometry.setAttribute("color", paint(skin, this.looks));
      const mesh = new SkinnedMesh(geometry, this.material);
      mesh.name = `${this.name}-skin`;
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.frustumCulled = false;
      const bones = [...Array(JOINTS).keys()].map((index) => {
        const bone = new Bone();
        bone.name = `${this.name}-${index === FOREARM ? "forearm" : index + 1}`;
        bone.matrixAutoUpdate = false;
        return bone;
      });
      mesh.add(...bones);
      mesh.bind(new Skeleton(bones, [...skin.bindInverses, skin.bindInverses[0]!]), new Matrix4());
      made = { mesh, bones };
      this.skeletons.set(skin, made);
    }
    return made;
  }
}

/** How much thicker and longer the bones of a rig are than those of a skin, along the joints' axes. */
function stretches(bound: HandRigSide, target: HandRigSide): Vector3[] {
  const length = (rig: HandRigSide, joint: number) => {
    const tip = TIP_OF_DIGIT.includes(joint);
    const [from, to] = joint <= WRIST ? [WRIST, FIRST_OF_DIGIT[2]! + 1] : tip ? [joint - 1, joint] : [joint, joint + 1];
    const [a, b] = [rig.stretched[from], rig.stretched[to]];
    return a && b ? new Vector3().setFromMatrixPosition(a).distanceTo(new Vector3().setFromMatrixPosition(b)) : 0;
  };
  const ratio = (a: number, b: number) => (a > 1e-4 && b > 1e-4 ? a / b : 1);
  const size = ratio(length(target, WRIST), length(bound, WRIST));
  return [...Array(JOINTS).keys()].map((joint) => {
    const along = ratio(length(target, joint), length(bound, joint));
    if (joint <= WRIST) return new Vector3(size, size, size);
    if (FIRST_OF_DIGIT.includes(joint)) return new Vector3(size, size, along);
    if (!target.stretched[joint]) return new Vector3(1e-3, 1e-3, 1e-3);
    const across = Math.min(Math.max(ratio(target.radii[joint]!, bound.radii[joint]!), size / 1.35), size * 1.35);
    return new Vector3(across, across, along);
  });
}
