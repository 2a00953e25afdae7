// Writes VRM avatars in T-pose, of capsules, with the built-in hands.

import { readFileSync } from "node:fs";
import { CapsuleGeometry, Quaternion, Vector3 } from "three";

const SKIN = 0;
const SHIRT = 1;
const BYTES = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };
// Bones of the body: their parents and places, in meters, facing +Z. Sides are added for those off the middle.
const BODY = [
  ["hips", null, [0, 0.92, 0]],
  ["spine", "hips", [0, 1.04, 0]],
  ["chest", "spine", [0, 1.18, 0]],
  ["neck", "chest", [0, 1.44, 0]],
  ["head", "neck", [0, 1.53, 0]],
  ["UpperArm", "chest", [0.19, 1.38, 0]],
  ["LowerArm", "UpperArm", [0.47, 1.38, 0]],
  ["Hand", "LowerArm", [0.72, 1.38, 0]],
  ["UpperLeg", "hips", [0.09, 0.88, 0]],
  ["LowerLeg", "UpperLeg", [0.09, 0.48, 0]],
  ["Foot", "LowerLeg", [0.09, 0.07, 0]],
];
// Capsules: the bone they follow, its other end, radius and material.
const CAPSULES = [
  ["hips", [0, 1.05, 0], 0.13, SHIRT],
  ["chest", [0, 1.34, 0], 0.14, SHIRT],
  ["neck", [0, 1.52, 0], 0.05, SKIN],
  ["head", [0, 1.64, 0.01], 0.1, SKIN],
  ["UpperArm", [0.47, 1.38, 0], 0.05, SHIRT],
  ["LowerArm", [0.68, 1.38, 0], 0.033, SHIRT],
  ["UpperLeg", [0.09, 0.48, 0], 0.075, SHIRT],
  ["LowerLeg", [0.09, 0.07, 0], 0.055, SHIRT],
  ["Foot", [0.09, 0.04, 0.13], 0.045, SKIN],
];
const FINGERS = { Index: "index-finger", Middle: "middle-finger", Ring: "ring-finger", Little: "pinky-finger" };
const THUMB = ["metacarpal", "phalanx-proximal", "phalanx-distal"];
const THUMB_BONES = { 0: ["Proximal", "Intermediate", "Distal"], 1: ["Metacarpal", "Proximal", "Distal"] };

function readGlb(path) {
  const file = readFileSync(path);
  const length = file.readUInt32LE(12);
  return { json: JSON.parse(file.subarray(20, 20 + length)), bin: file.subarray(28 + length) };
}

// The bytes of a VRM of version 0 or 1, whose humanoid names the fingers' bones or not.
export function avatar(version, hasFingers = true) {
  const json = {
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [] }],
    nodes: [],
    meshes: [],
    skins: [],
    accessors: [],
    bufferViews: [],
    materials: [],
  };
  for (const baseColorFactor of [
    [0.85, 0.62, 0.5, 1],
    [0.25, 0.42, 0.7, 1],
  ]) {
    json.materials.push({ pbrMetallicRoughness: { baseColorFactor, metallicFactor: 0, roughnessFactor: 0.8 } });
  }
  const pieces = [];
  let size = 0;
  const addView = (bytes) => {
    json.bufferViews.push({ buffer: 0, byteOffset: size, byteLength: bytes.length });
    const padded = Buffer.concat([bytes, Buffer.alloc(-bytes.length & 3)]);
    pieces.push(padded);
    size += padded.length;
    return json.bufferViews.length - 1;
  };
  const addArray = (array, type, bounds) => {
    const componentType = array instanceof Float32Array ? 5126 : 5125;
    const bytes = Buffer.from(array.buffer, array.byteOffset, array.byteLength);
    json.accessors.push({ bufferView: addView(bytes), componentType, count: array.length / BYTES[type], type, ...bounds });
    return json.accessors.length - 1;
  };
  const bones = {};
  const places = {};
  // VRM 0.x faces -Z.
  const facing = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), version === 0 ? Math.PI : 0);
  const place = ([x, y, z], mirror) => new Vector3(mirror * x, y, z).applyQuaternion(facing);

  for (const [bone, parent, at] of BODY) {
    for (const [side, mirror] of sidesOf(bone)) {
      const name = side + bone;
      places[name] = place(at, mirror);
      const parentName = parent && (bones[parent] === undefined ? side + parent : parent);
      const offset = parent ? places[name].clone().sub(places[parentName]) : places[name];
      bones[name] = json.nodes.push({ name, translation: offset.toArray(), children: [] }) - 1;
      (parent ? json.nodes[bones[parentName]].children : json.scenes[0].nodes).push(bones[name]);
    }
  }
  for (const [bone, end, radius, material] of CAPSULES) {
    for (const [side, mirror] of sidesOf(bone)) {
      addCapsule(bones[side + bone], places[side + bone], place(end, mirror), radius, material);
    }
  }
  for (const [side, mirror] of sidesOf("Hand")) {
    addHand(side, mirror);
  }
  json.buffers = [{ byteLength: size }];
  json.extensionsUsed = [version === 0 ? "VRM" : "VRMC_vrm"];
  json.extensions = version === 0 ? { VRM: vrm0(bones) } : { VRMC_vrm: vrm1(bones) };
  return glb(json, Buffer.concat(pieces));

  function addCapsule(node, from, to, radius, material) {
    const along = to.clone().sub(from);
    const geometry = new CapsuleGeometry(radius, along.length(), 6, 16);
    geometry.translate(0, along.length() / 2, 0);
    geometry.applyQuaternion(new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), along.normalize()));
    const { position, normal } = geometry.attributes;
    geometry.computeBoundingBox();
    const bounds = { min: geometry.boundingBox.min.toArray(), max: geometry.boundingBox.max.toArray() };
    const attributes = { POSITION: addArray(position.array, "VEC3", bounds), NORMAL: addArray(normal.array, "VEC3") };
    json.meshes.push({ primitives: [{ attributes, indices: addArray(Uint32Array.from(geometry.index.array), "SCALAR"), material }] });
    const mesh = json.nodes.push({ mesh: json.meshes.length - 1 }) - 1;
    json.nodes[node].children.push(mesh);
  }

  function addHand(side, mirror) {
    const { json: hand, bin } = readGlb(new URL(`../../../assets/hands/adult_${side}.glb`, import.meta.url));
    const accessorOf = hand.accessors.map((accessor) => {
      const { byteOffset = 0, byteLength } = hand.bufferViews[accessor.bufferView];
      json.accessors.push({ ...accessor, bufferView: addView(bin.subarray(byteOffset, byteOffset + byteLength)) });
      return json.accessors.length - 1;
    });
    const wrist = hand.nodes.findIndex(({ name }) => name === "wrist");
    const nodeOf = hand.nodes.map((node, index) =>
      index === wrist ? bones[`${side}Hand`] : json.nodes.push({ name: `${side}-${node.name}` }) - 1,
    );
    for (const [index, { translation, rotation, children = [] }] of hand.nodes.entries()) {
      const node = json.nodes[nodeOf[index]];
      node.children = [...(node.children ?? []), ...children.map((child) => nodeOf[child])];
      if (node.children.length === 0) {
        delete node.children;
      }
      if (index === wrist) {
        const turn = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), (-mirror * Math.PI) / 2);
        node.rotation = facing.clone().multiply(turn).toArray();
      } else {
        Object.assign(node, translation && { translation }, rotation && { rotation });
      }
    }
    const [{ primitives }] = hand.meshes;
    const [{ inverseBindMatrices, joints }] = hand.skins;
    json.skins.push({ inverseBindMatrices: accessorOf[inverseBindMatrices], joints: joints.map((joint) => nodeOf[joint]) });
    json.meshes.push({
      primitives: primitives.map(({ attributes, indices }) => ({
        attributes: Object.fromEntries(Object.entries(attributes).map(([name, accessor]) => [name, accessorOf[accessor]])),
        indices: accessorOf[indices],
        material: SKIN,
      })),
    });
    const skinned = hand.nodes.findIndex(({ mesh }) => mesh !== undefined);
    Object.assign(json.nodes[nodeOf[skinned]], { mesh: json.meshes.length - 1, skin: json.skins.length - 1 });
    json.scenes[0].nodes.push(nodeOf[skinned]);
    if (!hasFingers) {
      return;
    }
    const nodeNamed = (name) => nodeOf[hand.nodes.findIndex((node) => node.name === name)];
    THUMB.forEach((joint, link) => (bones[`${side}Thumb${THUMB_BONES[version][link]}`] = nodeNamed(`thumb-${joint}`)));
    for (const [finger, prefix] of Object.entries(FINGERS)) {
      for (const link of ["Proximal", "Intermediate", "Distal"]) {
        bones[`${side}${finger}${link}`] = nodeNamed(`${prefix}-phalanx-${link.toLowerCase()}`);
      }
    }
  }
}

function sidesOf(bone) {
  const isPaired = bone[0] === bone[0].toUpperCase();
  return isPaired
    ? [
        ["left", 1],
        ["right", -1],
      ]
    : [["", 1]];
}

function vrm0(bones) {
  const humanBones = Object.entries(bones).map(([bone, node]) => ({ bone, node, useDefaultValues: true }));
  return { specVersion: "0.0", meta: { title: "Capsules", author: "Grasp" }, humanoid: { humanBones } };
}

function vrm1(bones) {
  const humanBones = Object.fromEntries(Object.entries(bones).map(([bone, node]) => [bone, { node }]));
  const meta = { name: "Capsules", authors: ["Grasp"], licenseUrl: "https://vrm.dev/licenses/1.0/" };
  return { specVersion: "1.0", meta, humanoid: { humanBones } };
}

function glb(json, bin) {
  const text = Buffer.from(JSON.stringify(json));
  const padded = Buffer.concat([text, Buffer.alloc(-text.length & 3, " ")]);
  const chunk = (type, data) => Buffer.concat([Buffer.from(Uint32Array.of(data.length, type).buffer), data]);
  const chunks = Buffer.concat([chunk(0x4e4f534a, padded), chunk(0x004e4942, bin)]);
  return Buffer.concat([Buffer.from(Uint32Array.of(0x46546c67, 2, 12 + chunks.length).buffer), chunks]);
}
