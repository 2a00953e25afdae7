// The user pinches a remote control; a virtual hand takes it, and follows while the user's hand moves.

import { HemisphereLight, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { VRButton } from "three/addons/webxr/VRButton.js";
import {
  createGraspClient,
  CurrentGraspStatus,
  downloadMesh,
  GraspTracker,
  Handedness,
  poseMessage,
  presentingHand,
  trackedJoints,
} from "@grasp/client";
import { place, poseHand, poseOf } from "@grasp/client/three";

const OBJECT = "objects/remote";
const client = createGraspClient(new URLSearchParams(location.search).get("server") ?? "http://localhost:50051");
const tracker = new GraspTracker(
  client,
  { holdout: { object: OBJECT }, mayChangeHand: true },
  {
    onStatus: (status) => console.log(CurrentGraspStatus[status]),
    onError: (error) => console.error(error.message),
  },
);

const loader = new GLTFLoader();
const object = (await loader.parseAsync((await downloadMesh(client, OBJECT)).buffer, "")).scene;
async function loadHands() {
  const [left, right] = ["left", "right"].map((side) => loader.loadAsync(`../../../assets/hands/adult_${side}.glb`));
  return new Map([
    [Handedness.LEFT, (await left).scene],
    [Handedness.RIGHT, (await right).scene],
  ]);
}
const [givers, takers] = [await loadHands(), await loadHands()];

const renderer = new WebGLRenderer({ antialias: true });
renderer.setSize(innerWidth, innerHeight);
renderer.setClearColor("lightgray");
renderer.xr.enabled = true;
document.body.append(renderer.domElement, VRButton.createButton(renderer, { requiredFeatures: ["hand-tracking"] }));
const scene = new Scene().add(object, ...givers.values(), ...takers.values(), new HemisphereLight("white", "dimgray", 4));
const camera = new PerspectiveCamera(60, innerWidth / innerHeight, 0.01, 10);

// Poses the hand of its side, and hides the other one.
function show(models, hand) {
  for (const [handedness, model] of models) {
    model.visible = handedness === hand?.handedness;
    if (model.visible) {
      poseHand(model, hand);
    }
  }
}

// Puts the object between thumb and index finger, along the hand.
function hold({ joints }) {
  const [wrist, thumb, index] = [joints[0], joints[4], joints[9]].map(({ pose }) => pose);
  place(object, wrist);
  object.rotateX(-Math.PI / 2);
  const grip = new Vector3().addVectors(thumb.position, index.position).divideScalar(2);
  object.position.copy(grip).add(new Vector3(0, 0.07, 0).applyQuaternion(object.quaternion));
}

renderer.setAnimationLoop((_, frame) => {
  const giver = frame && [...frame.session.inputSources].find(({ hand }) => hand);
  const joints = giver && trackedJoints(frame, giver, renderer.xr.getReferenceSpace());
  if (joints) {
    if (presentingHand(joints)) {
      hold(joints);
    }
    tracker.push({ holdout: { clientFromObject: poseMessage(poseOf(object)), presentingHand: presentingHand(joints, true) } });
  }
  show(givers, joints);
  show(takers, tracker.handAt(poseOf(object)));
  renderer.render(scene, camera);
});
