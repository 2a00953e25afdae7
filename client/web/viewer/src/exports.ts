/** Downloads: the scene as GLB, the answer as JSON, the grasp in Isaac Sim's format. */
import { type JsonValue, toJson } from "@bufbuild/protobuf";
import { BufferGeometry, Color, Float32BufferAttribute, Group, Mesh, MeshStandardMaterial, Scene, SkinnedMesh, Vector3 } from "three";
import { GLTFExporter } from "three/addons/exporters/GLTFExporter.js";

import { GraspSchema, type Grasp, KeyFrameKind } from "#contract/grasp_pb";
import { type HandPose, Handedness } from "#contract/holdout_pb";
import type { App } from "./app";
import { download, toast } from "./dom";
import { DIGIT_NAMES, digitsOf } from "./kinematics";
import { quaternion, vector } from "./poses";
import { requestJson } from "./snippets";
import { objectName } from "./words";

/** The drawn parts of the stage, with skins as they are posed, so that every viewer shows them alike. */
export async function sceneGlb(app: App): Promise<ArrayBuffer> {
  const scene = new Scene();
  const { view } = app;
  view.stage.scene.updateMatrixWorld(true);
  const parts = [view.object.group, view.giver.group, view.receiver.group, view.people.giver.group, view.people.receiver.group, view.models.group];
  for (const part of parts) {
    const group = new Group();
    group.name = part.name;
    part.traverseVisible((node) => {
      if (!(node instanceof Mesh) || "isInstancedMesh" in node) return;
      const baked = bake(node as Mesh);
      if (baked) group.add(baked);
    });
    if (part.visible && group.children.length > 0) scene.add(group);
  }
  return (await new GLTFExporter().parseAsync(scene, { binary: true })) as ArrayBuffer;
}

function bake(mesh: Mesh): Mesh | null {
  const { position, color, uv } = mesh.geometry.attributes;
  if (!position) return null;
  const geometry = new BufferGeometry();
  const at = new Float32Array(3 * position.count);
  const point = new Vector3();
  for (let i = 0; i < position.count; i++) {
    point.fromBufferAttribute(position, i);
    if (mesh instanceof SkinnedMesh) mesh.applyBoneTransform(i, point);
    point.applyMatrix4(mesh.matrixWorld).toArray(at, 3 * i);
  }
  geometry.setAttribute("position", new Float32BufferAttribute(at, 3));
  if (color) geometry.setAttribute("color", color);
  if (uv) geometry.setAttribute("uv", uv);
  geometry.setIndex(mesh.geometry.index);
  geometry.computeVertexNormals();
  // Vertices of flat triangles alone have none.
  const normal = geometry.attributes.normal!;
  for (let i = 0; i < normal.count; i++) {
    point.fromBufferAttribute(normal, i);
    if (Math.abs(point.length() - 1) > 1e-4) normal.setXYZ(i, 0, 1, 0);
  }
  const own = (Array.isArray(mesh.material) ? mesh.material[0]! : mesh.material) as MeshStandardMaterial;
  const material = new MeshStandardMaterial({ vertexColors: Boolean(color), roughness: own.roughness ?? 0.8, metalness: own.metalness ?? 0, color: own.color ?? new Color("white"), map: own.map ?? null });
  const baked = new Mesh(geometry, material);
  baked.name = mesh.name;
  return baked;
}

/** The request and the shown grasp in protobuf's JSON. */
export function answerJson(app: App, grasp: Grasp): string {
  const answer = toJson(GraspSchema, grasp) as JsonValue;
  return `${JSON.stringify({ request: JSON.parse(requestJson(app)) as JsonValue, grasp: answer }, null, 2)}\n`;
}

function joints(hand: HandPose): string {
  return DIGIT_NAMES.flatMap((name, digit) => {
    if (!hand[name]) return [];
    const [yaw, ...pitches] = digitsOf(hand)[digit]!;
    return [["base_yaw", yaw], ["base_pitch", pitches[0]], ["second_pitch", pitches[1]], ["third_pitch", pitches[2]]].map(
      ([joint, angle]) => `      ${name}_${joint}: ${(angle as number).toFixed(6)}`,
    );
  }).join("\n");
}

/** A hand as the command line names it: rigs/adult/left, and its size if it is not the rig's. */
function gripperName({ rig, handedness, scale }: HandPose): string {
  const side = handedness === Handedness.LEFT ? "left" : "right";
  return [rig, side, ...(scale === undefined ? [] : [scale])].join("/");
}

/** Grasps in the format isaac_grasp 1.0 of Isaac Sim's Grasp Editor. */
export function isaacGrasps(grasps: Grasp[]): string {
  const [first] = grasps;
  const lines = grasps.flatMap((grasp, index) => {
    const { hand } = grasp;
    if (!hand) return [];
    const [at, turn] = [vector(hand.objectFromWrist?.position), quaternion(hand.objectFromWrist?.orientation)];
    const list = (values: number[]) => `[${values.map((value) => value.toFixed(6)).join(", ")}]`;
    const open = grasp.keyFrames.find(({ kind }) => kind === KeyFrameKind.PRE_GRASP)?.hand ?? hand;
    return [
      `  grasp_${index}:`,
      `    confidence: ${(grasp.score ?? 1).toFixed(4)}`,
      `    position: ${list([at.x, at.y, at.z])}`,
      `    orientation: {w: ${turn.w.toFixed(6)}, xyz: ${list([turn.x, turn.y, turn.z])}}`,
      "    cspace_position:",
      joints(hand),
      "    pregrasp_cspace_position:",
      joints(open),
    ];
  });
  const gripper = first?.hand ? gripperName(first.hand) : "";
  return ["format: isaac_grasp", "format_version: 1.0", "", "object_frame: object", `gripper_frame: ${gripper}`, "", "grasps:", ...lines, ""].join("\n");
}

/** Downloads of the shown grasp, by the name of the format. */
export function downloads(app: App): [string, string, () => void][] {
  const name = () => objectName(app.state.object);
  const withGrasp = (then: (grasp: Grasp) => void) => () => {
    if (app.answer?.grasp) then(app.answer.grasp);
    else toast("There is no grasp to download", "bad");
  };
  return [
    ["glb", "Scene (GLB)", () => void sceneGlb(app).then((glb) => download(`${name()}.glb`, "model/gltf-binary", glb))],
    ["json", "Request and grasp (JSON)", withGrasp((grasp) => download(`${name()}.json`, "application/json", answerJson(app, grasp)))],
    ["isaac", "isaac_grasp (YAML)", withGrasp((grasp) => download(`${name()}.yaml`, "application/yaml", isaacGrasps([grasp])))],
  ];
}
