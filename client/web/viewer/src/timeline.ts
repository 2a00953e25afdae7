/** The bar below: scrubs the motion to the grasp, or a recording of a giver. */
import { fromJson, type JsonValue } from "@bufbuild/protobuf";

import { KeyFrameKind, type Grasp } from "#contract/grasp_pb";
import type { Holdout } from "#contract/holdout_pb";
import { TrackFrameSchema, TrackSchema } from "#contract/track_pb";
import type { App } from "./app";
import { button, byId, element, toast } from "./dom";
import { type Angles, digitsOf, sideOf } from "./kinematics";
import { between, poseOf, type Pose, wireMatrix } from "./poses";
import { type Giver, stateFor } from "./state";

const WORDS: Partial<Record<KeyFrameKind, string>> = {
  [KeyFrameKind.APPROACH]: "drawn back",
  [KeyFrameKind.PRE_GRASP]: "open",
  [KeyFrameKind.CLOSE]: "closed",
};

/** Seconds that the motion to a grasp takes. */
const REACH = 1.6;

interface Recording {
  name: string;
  object: string;
  frames: { seconds: number; holdout: Holdout }[];
}

export class Timeline {
  private readonly bar = byId("time");
  private readonly slider = element("input", { type: "range", min: "0", max: "1", step: "0.001", value: "1", id: "scrub" });
  private readonly words = element("span", { class: "dim" });
  private readonly play = button("▶", () => this.toggle(), { id: "play", title: "Play" });
  private readonly close = button("×", () => this.end(), { title: "Close the recording" });
  private recording: Recording | null = null;
  private isPlaying = false;
  private at = 1;

  constructor(private readonly app: App) {
    this.bar.append(this.play, this.slider, this.words, this.close);
    this.bar.hidden = true;
    this.slider.addEventListener("input", () => {
      this.isPlaying = false;
      this.to(Number(this.slider.value));
    });
    app.onAnswer.push(() => this.show());
    app.onState.push(() => {
      if (this.recording && app.state.object !== this.recording.object) this.recording = null;
      this.show();
    });
  }

  /** Plays a recording as `grasp track --print-motion` prints it: a track and its frames. */
  open(name: string, text: string): void {
    try {
      const file = JSON.parse(text) as { track: JsonValue; frames: JsonValue[] };
      const track = fromJson(TrackSchema, file.track);
      const frames = file.frames.map((json) => fromJson(TrackFrameSchema, json));
      const object = track.holdout?.object ?? "";
      const sound = frames.flatMap(({ holdout, captureTime }, index) =>
        holdout ? [{ holdout, seconds: captureTime ? Number(captureTime.seconds) + captureTime.nanos / 1e9 : index / 90 }] : [],
      );
      if (!object || sound.length === 0) throw new Error("it has no object or no frames");
      const first = sound[0]!.seconds;
      for (const frame of sound) frame.seconds -= first;
      const start = { ...stateFor(object), pose: poseOf(wireMatrix(sound[0]!.holdout.clientFromObject)) };
      const giver = this.giverOf(sound[0]!.holdout);
      this.app.open({ ...start, holdout: "", giver });
      this.recording = { name, object, frames: sound };
      this.at = 0;
      this.show();
      // Frames hold on to the first grasp.
      void this.app.finding.then(() => this.recording?.name === name && this.toggle());
    } catch (error) {
      toast(`${name} is not a recording: ${error instanceof Error ? error.message : String(error)}`, "bad");
    }
  }

  private end(): void {
    this.recording = null;
    this.isPlaying = false;
    this.at = 1;
    this.app.view.showState(this.app.state);
    this.app.follow();
    this.show();
  }

  /** The giver's angles in a holdout; `null` for tracked joints and meshes. */
  private giverOf(holdout: Holdout): Giver | null {
    const form = holdout.presentingHand?.form;
    if (form?.case !== "pose") return null;
    const hand = form.value;
    return { rig: hand.rig, side: sideOf(hand.handedness), scale: hand.scale ?? 1, wrist: poseOf(wireMatrix(hand.clientFromWrist)), digits: digitsOf(hand), open: 0 };
  }

  private get length(): number {
    return this.recording ? Math.max(this.recording.frames.at(-1)!.seconds, 0.01) : REACH;
  }

  private show(): void {
    const grasp = this.app.answer?.grasp;
    const { recording } = this;
    this.close.hidden = recording === null;
    this.bar.hidden = recording === null && (grasp?.keyFrames.length ?? 0) < 2;
    if (!recording && !this.isPlaying) this.at = 1;
    this.slider.value = String(this.at);
    this.label();
  }

  private label(): void {
    const { recording } = this;
    const grasp = this.app.answer?.grasp;
    this.play.textContent = this.isPlaying ? "❚❚" : "▶";
    if (recording) {
      this.words.textContent = `${recording.name} ${(this.at * this.length).toFixed(2)} s`;
      return;
    }
    const frames = grasp?.keyFrames ?? [];
    const kind = frames[Math.round(this.at * (frames.length - 1))]?.kind;
    this.words.textContent = kind === undefined ? "" : (WORDS[kind] ?? "");
  }

  private toggle(): void {
    this.isPlaying = !this.isPlaying;
    if (this.isPlaying && this.at >= 1) this.at = 0;
    this.label();
    let last = performance.now();
    const step = () => {
      if (!this.isPlaying) return;
      const now = performance.now();
      this.at = Math.min(this.at + (now - last) / 1000 / this.length, 1);
      last = now;
      this.to(this.at);
      this.isPlaying = this.at < 1;
      this.label();
      if (this.isPlaying) requestAnimationFrame(step);
    };
    if (this.isPlaying) requestAnimationFrame(step);
  }

  /** Shows a share of the way. */
  private to(at: number): void {
    this.at = at;
    this.slider.value = String(at);
    if (this.recording) this.toFrame(this.recording);
    else if (this.app.answer?.grasp) this.toKeyFrame(this.app.answer.grasp);
    this.label();
  }

  private toKeyFrame(grasp: Grasp): void {
    const frames = grasp.keyFrames;
    if (this.at >= 1 || frames.length < 2) {
      this.app.view.showGrasp(grasp, this.app.state);
      return;
    }
    const place = this.at * (frames.length - 1);
    const index = Math.floor(place);
    const [from, to] = [frames[index]!.hand, frames[index + 1]!.hand];
    if (!from || !to) return;
    const share = place - index;
    const wrist: Pose = between(poseOf(wireMatrix(from.clientFromWrist)), poseOf(wireMatrix(to.clientFromWrist)), share);
    const [a, b] = [digitsOf(from), digitsOf(to)];
    const digits = a.map((angles, digit) => angles.map((angle, i) => angle + share * (b[digit]![i]! - angle)) as Angles);
    this.app.view.showOnTheWay(to, wrist, digits);
  }

  private toFrame({ object, frames }: Recording): void {
    const seconds = this.at * this.length;
    const frame = frames.findLast((each) => each.seconds <= seconds + 1e-6) ?? frames[0]!;
    const { holdout } = frame;
    const { view, state, follower } = this.app;
    const giver = this.giverOf(holdout);
    const pose = poseOf(wireMatrix(holdout.clientFromObject));
    view.showState({ ...state, pose, giver });
    const form = holdout.presentingHand?.form;
    if (form?.case === "joints") {
      const joints = form.value.joints.map((joint) => (joint.pose ? wireMatrix(joint.pose) : null));
      // WebXR has no palm.
      view.showGivenJoints(joints.length === 25 ? [joints[0]!, ...joints] : joints, { rig: "rigs/adult", side: sideOf(form.value.handedness), scale: 1 });
    }
    follower.push({ ...holdout, object, scale: undefined });
  }
}

