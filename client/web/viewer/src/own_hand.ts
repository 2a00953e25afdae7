/** WebXR: the user holds the object out with their own hand, and the character takes it. */
import { Matrix4 } from "three";

import type { App } from "./app";
import * as api from "./api";
import { button, toast } from "./dom";
import { handedness } from "./kinematics";
import { matrix, poseOf, wirePose } from "./poses";

/** Where the user stands, and faces +Z as the giver does: distance from the object, in meters. */
const DISTANCE = 0.5;

/** A button that begins and ends a session, if the browser has a headset. */
export function ownHandButton(app: App): HTMLElement {
  const made = button("Use my hand", () => void (session ? session.end() : begin()), { id: "xr", hidden: true, title: "Hold the object out with your own hand (WebXR)" });
  let session: XRSession | null = null;
  let mode: XRSessionMode = "immersive-vr";
  const { xr } = app.stage.renderer;

  void (async () => {
    for (const each of ["immersive-ar", "immersive-vr"] as const) {
      if (!(await navigator.xr?.isSessionSupported(each).catch(() => false))) continue;
      mode = each;
      made.hidden = false;
      return;
    }
  })();

  async function begin(): Promise<void> {
    try {
      session = await navigator.xr!.requestSession(mode, { requiredFeatures: ["hand-tracking", "local-floor"] });
      session.addEventListener("end", end);
      xr.enabled = true;
      xr.setReferenceSpaceType("local-floor");
      await xr.setSession(session);
      const { rig, ground } = app.stage;
      rig.position.set(app.state.pose.p[0], ground.position.y, app.state.pose.p[2] - DISTANCE);
      rig.rotation.y = Math.PI;
      made.textContent = "Leave";
      app.stage.draw();
    } catch (error) {
      toast(api.inWords(error), "bad");
    }
  }

  function end(): void {
    session = null;
    xr.enabled = false;
    app.stage.rig.position.set(0, 0, 0);
    app.stage.rig.rotation.y = 0;
    made.textContent = "Use my hand";
    app.view.showState(app.state);
    app.follow();
    app.stage.resize();
  }

  app.stage.beforeDraw.push(() => {
    const frame = xr.isPresenting ? xr.getFrame() : null;
    const space = xr.getReferenceSpace();
    if (session && frame && space) hold(app, session, frame, space);
  });
  return made;
}

/** Puts the object into the user's hand as the giver holds it, and asks who takes it how. */
function hold(app: App, session: XRSession, frame: XRFrame, space: XRReferenceSpace): void {
  const { state, view } = app;
  const side = state.giver?.side ?? "right";
  const hand = [...session.inputSources].find((source) => source.hand && source.handedness === side)?.hand;
  if (!hand || !frame.getJointPose) return;
  const poses = [...hand.values()].map((joint) => frame.getJointPose!(joint, space));
  if (poses.some((pose) => !pose)) return;
  const { rig } = app.stage;
  rig.updateMatrixWorld();
  const joints = poses.map((pose) => new Matrix4().fromArray(pose!.transform.matrix).premultiply(rig.matrixWorld));
  const wrist = joints[0]!;
  const held = state.giver ? matrix(state.giver.wrist).invert().multiply(matrix(state.pose)) : new Matrix4().makeTranslation(0, -0.02, -0.1);
  const pose = poseOf(wrist.clone().multiply(held));
  view.showState({ ...state, pose, giver: null });
  view.showGivenJoints([wrist, ...joints], { rig: "rigs/adult", side, scale: 1 });
  view.people.giver.group.visible = false;
  const value = { handedness: handedness(side), joints: joints.map((joint, i) => ({ pose: wirePose(poseOf(joint)), radius: poses[i]!.radius ?? 0 })) };
  app.follower.push({ object: state.object, clientFromObject: wirePose(pose), presentingHand: { form: { case: "joints", value } } });
}
