/** The held object. */
import { Color, Group, Mesh, MeshStandardMaterial, type BufferGeometry, Float32BufferAttribute } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { mergeGeometries, toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";

import * as api from "./api";

/** Angle between faces from which an edge is sharp, in radians. */
const CREASE = 0.6;

export const SURFACE = new Color("#c9a15f");
const FORBIDDEN = new Color("#b9463e");

/** The mesh that searches use, in the object's frame. */
export interface ObjectMesh {
  /** The file as the server sent it. */
  glb: Uint8Array<ArrayBuffer>;
  /** Three corners per triangle, in the file's order; forbidden ones last. */
  geometry: BufferGeometry;
  /** The number of each triangle in the file that the object was created from. */
  numbers: number[];
}

const meshes = new Map<string, Promise<ObjectMesh>>();

/** An object's mesh, by its name and the state that it has. */
export function meshOf(name: string, etag: string): Promise<ObjectMesh> {
  const key = `${name} ${etag}`;
  let mesh = meshes.get(key);
  if (!mesh) {
    mesh = load(name);
    mesh.catch(() => meshes.delete(key));
    meshes.set(key, mesh);
  }
  return mesh;
}

const ahead = new Map<string, Promise<Uint8Array<ArrayBuffer>>>();

/** Fetches a mesh that will be wanted once the object's state is known. */
export function fetchAhead(name: string): void {
  const mesh = api.mesh(name);
  // Handled where it is awaited.
  mesh.catch(() => undefined);
  ahead.set(name, mesh);
}

async function load(name: string): Promise<ObjectMesh> {
  const fetched = ahead.get(name) ?? api.mesh(name);
  ahead.delete(name);
  const glb = await fetched;
  const gltf = await new GLTFLoader().parseAsync(glb.buffer, "");
  const parts: BufferGeometry[] = [];
  const forbidden: number[] = [];
  gltf.scene.updateMatrixWorld(true);
  gltf.scene.traverse((node) => {
    if (!(node instanceof Mesh)) return;
    const part = (node.geometry as BufferGeometry).clone().applyMatrix4(node.matrixWorld);
    for (const attribute of Object.keys(part.attributes)) if (attribute !== "position") part.deleteAttribute(attribute);
    const open = part.index ? part.toNonIndexed() : part;
    const isForbidden = (node.material as MeshStandardMaterial).name === "forbidden";
    const color = isForbidden ? FORBIDDEN : SURFACE;
    const colors = new Float32Array(open.attributes.position!.count * 3);
    for (let i = 0; i < colors.length; i += 3) color.toArray(colors, i);
    open.setAttribute("color", new Float32BufferAttribute(colors, 3));
    parts.push(open);
    for (const [first, count] of (part.userData.triangles ?? []) as [number, number][]) {
      for (let i = 0; i < count; i++) forbidden.push(first + i);
    }
  });
  const geometry = toCreasedNormals(mergeGeometries(parts), CREASE);
  const isForbidden = new Set(forbidden);
  const all = [...Array(geometry.attributes.position!.count / 3).keys()];
  return { glb, geometry, numbers: [...all.filter((number) => !isForbidden.has(number)), ...forbidden] };
}

/** The object on the stage. */
export class HeldObject {
  readonly group = new Group();
  readonly material = new MeshStandardMaterial({ vertexColors: true, roughness: 0.42, metalness: 0.12 });
  readonly mesh = new Mesh<BufferGeometry, MeshStandardMaterial>(undefined, this.material);

  constructor() {
    this.group.name = "object";
    this.mesh.name = "object-surface";
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.group.add(this.mesh);
  }

  show({ geometry }: ObjectMesh): void {
    this.mesh.geometry = geometry;
    geometry.computeBoundingSphere();
  }
}
