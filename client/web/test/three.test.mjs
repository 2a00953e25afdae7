import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { VRMLoaderPlugin, VRMUtils } from "@pixiv/three-vrm";
import { Group, Object3D, Quaternion, Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { create } from "@bufbuild/protobuf";
import { Convention, convertHand, Handedness, HandPoseSchema, jointsOf, poseMessage } from "@grasp/client";
import { place, poseHand, poseModel, poseOf } from "@grasp/client/three";
import { VrmArm } from "@grasp/client/vrm";
import { avatar } from "./avatar.mjs";
import { assertNear, assertSamePose, rigs, vectors } from "./golden.mjs";

// Browsers have it; the loader asks for it.
globalThis.self = globalThis;

const load = (bytes, loader = new GLTFLoader()) =>
  loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), "");
const hands = await Promise.all(
  ["left", "right"].map(
    async (side) => (await load(readFileSync(new URL(`../../../assets/hands/adult_${side}.glb`, import.meta.url)))).scene,
  ),
);
const spot = { position: { x: 0.3, y: -0.2, z: 1 }, orientation: { x: 0.5, y: 0.5, z: -0.5, w: 0.5 } };

test("every bone of a hand goes to its joint, in every convention, wherever the hand is in the scene", () => {
  const parent = new Group();
  place(parent, poseMessage(spot));
  parent.scale.setScalar(2);
  for (const { name, conventions } of vectors) {
    for (const { grasp } of conventions) {
      const hand = hands[grasp.hand.handedness - 1];
      const joints = jointsOf(conventions[0].grasp.hand).slice(1);
      for (const root of [hand, parent.add(hand)]) {
        poseHand(root, grasp.hand);
        root.updateWorldMatrix(true, true);
        for (const joint of joints) {
          assertSamePose(poseOf(hand.getObjectByName(joint.name)), joint.pose, 1e-4, 1e-4, `${name}, ${joint.name}`);
        }
      }
      parent.clear();
    }
  }
});

test("a hand is posed in its space, with its size", () => {
  const space = new Object3D();
  place(space, poseMessage(spot));
  const { hand } = vectors[0].conventions[0].grasp;
  const model = hands[hand.handedness - 1];
  poseHand(model, { ...hand, scale: 1.5 }, space);
  space.updateMatrixWorld();
  const [tip] = jointsOf(hand).filter(({ name }) => name === "thumb-tip");
  const bone = model.getObjectByName("thumb-tip");
  assertNear(poseOf(bone).position, space.localToWorld(new Vector3().copy(tip.pose.position)), 1e-5, "the thumb's tip");
  assertNear(bone.getWorldScale(new Vector3()), { x: 1.5, y: 1.5, z: 1.5 }, 1e-5, "the size");
});

test("a rig's own model is posed by its nodes", () => {
  const [root, arm, finger] = ["Armature", "hand.L", "finger.L"].map((name) => Object.assign(new Object3D(), { name }));
  root.add(arm);
  // As the loader names them, without dots.
  arm.name = "handL";
  finger.name = "fingerL";
  arm.add(finger);
  finger.position.set(0, 0.1, 0);
  const turn = { x: 0, y: 0, z: Math.SQRT1_2, w: Math.SQRT1_2 };
  const model = [
    { node: "hand.L", pose: poseMessage(spot) },
    { node: "finger.L", pose: { orientation: turn } },
    { node: "missing", pose: poseMessage(spot) },
  ];
  const hand = create(HandPoseSchema, { model, convention: Convention.OPENXR });
  poseModel(root, convertHand(hand, Convention.UNITY_FLIP_X));
  assertSamePose(poseOf(arm), spot, 1e-6, 1e-5, "the root");
  assertNear(finger.position, { x: 0, y: 0.1, z: 0 }, 1e-9, "the file's place");
  assertNear(finger.quaternion, turn, 1e-6, "the turn");
});

for (const version of [0, 1]) {
  test(`the bones of an avatar of VRM ${version} go to a grasp's joints`, async () => {
    const loader = new GLTFLoader().register((parser) => new VRMLoaderPlugin(parser));
    const { vrm } = (await load(avatar(version), loader)).userData;
    VRMUtils.rotateVRM0(vrm);
    vrm.scene.position.set(0.5, -1.2, -0.6);
    vrm.scene.rotateY(0.3);
    for (const handedness of [Handedness.LEFT, Handedness.RIGHT]) {
      const arm = new VrmArm(vrm, rigs.get("rigs/adult"), handedness);
      const side = handedness === Handedness.LEFT ? "left" : "right";
      const shoulder = new Vector3().copy(arm.receiver.body.value);
      assertNear(shoulder, poseOf(vrm.humanoid.getRawBoneNode(`${side}UpperArm`)).position, 1e-6, "the shoulder");
      const poses = vectors.flatMap(({ conventions }) => conventions).filter(({ grasp }) => grasp.hand.handedness === handedness);
      assert.ok(poses.length > 0);
      for (const { grasp } of poses) {
        // Brings the object within reach.
        const space = new Object3D();
        space.position
          .copy(shoulder)
          .add(new Vector3(0, -0.15, 0.3))
          .sub(jointsOf(grasp.hand)[1].pose.position);
        const reaching = new VrmArm(vrm, rigs.get("rigs/adult"), handedness, space);
        assert.ok(reaching.pose(grasp.hand) < 1e-6);
        vrm.update(0.01);
        vrm.scene.updateMatrixWorld(true);
        for (const { name, pose } of jointsOf(grasp.hand).filter((joint) => /wrist|thumb|phalanx|tip/.test(joint.name))) {
          const bone = vrm.scene.getObjectByName(name === "wrist" ? `${side}Hand` : `${side}-${name}`);
          assertNear(poseOf(bone).position, space.localToWorld(new Vector3().copy(pose.position)), 1e-4, `${side}-${name}`);
        }
        // Without an arm in the answer, the elbow hangs.
        assert.ok(poseOf(vrm.humanoid.getRawBoneNode(`${side}LowerArm`)).position.y < shoulder.y);
      }
    }
  });
}

test("an avatar without fingers turns its hand alike", async () => {
  const loader = () => new GLTFLoader().register((parser) => new VRMLoaderPlugin(parser));
  for (const handedness of [Handedness.LEFT, Handedness.RIGHT]) {
    const { grasp } = vectors.map(({ conventions }) => conventions[0]).find(({ grasp }) => grasp.hand.handedness === handedness);
    const turns = [];
    for (const hasFingers of [true, false]) {
      const { vrm } = (await load(avatar(1, hasFingers), loader())).userData;
      new VrmArm(vrm, rigs.get("rigs/adult"), handedness).pose(grasp.hand, grasp.arm);
      vrm.update(0.01);
      const hand = vrm.humanoid.getRawBoneNode(handedness === Handedness.LEFT ? "leftHand" : "rightHand");
      turns.push(hand.getWorldQuaternion(new Quaternion()));
    }
    assert.ok(turns[0].angleTo(turns[1]) < 0.15);
  }
});
