// An avatar (avatar.html?vrm=URL) takes a remote control that is held out in front of it, again and again.

import { HemisphereLight, PerspectiveCamera, Scene, Timer, WebGLRenderer } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { VRMLoaderPlugin, VRMUtils } from "@pixiv/three-vrm";
import { createGraspClient, createRigOnce, downloadMesh, Handedness, playKeyFrames } from "@grasp/client";
import { place } from "@grasp/client/three";
import { VrmArm } from "@grasp/client/vrm";

const OBJECT = "objects/remote";
const query = new URLSearchParams(location.search);
const client = createGraspClient(query.get("server") ?? "http://localhost:50051");
const loader = new GLTFLoader().register((parser) => new VRMLoaderPlugin(parser));
const file = await (await fetch(query.get("vrm") ?? "avatar.vrm")).arrayBuffer();
const { vrm } = (await loader.parseAsync(file.slice(), "")).userData;
VRMUtils.rotateVRM0(vrm);
vrm.scene.traverse((part) => (part.frustumCulled = false));
for (const [side, sign] of [
  ["left", -1],
  ["right", 1],
]) {
  vrm.humanoid.getNormalizedBoneNode(`${side}UpperArm`).rotation.z = 1.3 * sign * (vrm.meta.metaVersion === "0" ? -1 : 1);
}

// The rig of the avatar's own hands. Its id names the file's content.
const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", file), 0, 8);
const id = Array.from(hash, (byte) => byte.toString(16).padStart(2, "0")).join("");
const rig = await createRigOnce(client, `avatar-${id}`, new Uint8Array(file));
const arm = new VrmArm(vrm, rig, Handedness.RIGHT);

// In front of the chest, within reach, upright.
const { receiver } = arm;
const { y, z } = receiver.body.value;
const reach = receiver.upperArmLength + receiver.forearmLength;
const clientFromObject = { position: { x: 0, y: y - 0.3 * reach, z: z + 0.85 * reach } };
const {
  grasps: [grasp],
} = await client.grasps.findGrasp({ holdout: { object: OBJECT, clientFromObject }, receiver, output: { keyFrames: true } });
if (!grasp) {
  throw new Error("No grasp was found in time.");
}

const object = (await loader.parseAsync((await downloadMesh(client, OBJECT)).buffer, "")).scene;
place(object, { position: clientFromObject.position });
const scene = new Scene().add(vrm.scene, object, new HemisphereLight("white", "dimgray", 4));
const camera = new PerspectiveCamera(30, innerWidth / innerHeight, 0.01, 10);
camera.position.set(-0.9, y + 0.1, z + 1.4);
camera.lookAt(-0.1, y - 0.15, z + 0.2);
const renderer = new WebGLRenderer({ antialias: true });
renderer.setSize(innerWidth, innerHeight);
renderer.setClearColor("lightgray");
document.body.append(renderer.domElement);
const timer = new Timer();
renderer.setAnimationLoop((time) => {
  timer.update(time);
  // A second of motion, then two at rest.
  arm.pose(playKeyFrames(grasp, timer.getElapsed() % 3), grasp.arm);
  vrm.update(timer.getDelta());
  renderer.render(scene, camera);
});
