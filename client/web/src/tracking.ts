/** Holds on to a grasp while giver and object move. */

import type { MessageInitShape } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { retryDelay, type GraspClient } from "./client.js";
import { CurrentGraspStatus, type CurrentGraspReport, type Grasp } from "./gen/grasp/v1/grasp_pb.js";
import type { HandPose } from "./gen/grasp/v1/holdout_pb.js";
import type { TrackAnswer, TrackFrame, TrackFrameSchema, TrackSchema } from "./gen/grasp/v1/track_pb.js";
import { handAt } from "./hand.js";
import { handBetween } from "./keyFrames.js";
import { compose, inverse, rigid, type Rigid } from "./pose.js";

/** A frame as it is pushed: `track` and `sequence` are the tracker's, `captureTime` is now unless given. */
export type PushedFrame = Omit<Exclude<MessageInitShape<typeof TrackFrameSchema>, TrackFrame>, "track" | "sequence">;

/** Calls that a tracker makes. */
export interface TrackerEvents {
  /** The grasp was replaced, adjusted, lost or given up, or is kept again. */
  onStatus?: (status: CurrentGraspStatus, report: CurrentGraspReport) => void;
  /** A frame was answered. */
  onAnswer?: (answer: TrackAnswer) => void;
  /** A call failed; the next frame is sent as usual. */
  onError?: (error: ConnectError) => void;
}

/** How long the hand takes from one grasp to the next, in milliseconds. */
const CHANGE_TIME = 150;

/** How long no frame is sent after an error, in milliseconds, unless the server says. */
const PAUSE = 250;

/**
 * A giver who is tracked. Push a frame whenever poses change, and draw `handAt` the object in each picture: one frame is on its way at a
 * time, and the newest follows it, so that slow networks get fewer frames and no old ones.
 */
export class GraspTracker {
  private name = "";
  private sequence = 0n;
  private next: PushedFrame | undefined;
  private sending: Promise<void> | undefined;
  private isOpen = true;
  private previous: HandPose | undefined;
  private changedAt = 0;

  /** The grasp of the last answer; absent if there is none. */
  grasp: Grasp | undefined;
  /** The status of the last answer; `UNSPECIFIED` before the first. */
  status = CurrentGraspStatus.UNSPECIFIED;

  /** `track` has the object and all that frames do not change. */
  constructor(
    private readonly client: GraspClient,
    private readonly track: MessageInitShape<typeof TrackSchema>,
    private readonly events: TrackerEvents = {},
  ) {}

  /** Sends a frame, or the next one in its place. */
  push(frame: PushedFrame): void {
    const now = performance.now();
    const captureTime = { seconds: BigInt(Math.floor(now / 1000)), nanos: Math.floor((now % 1000) * 1e6) };
    this.next = { captureTime, ...frame };
    this.sending ??= this.send().finally(() => (this.sending = undefined));
  }

  /**
   * The hand for a picture, with the object at `clientFromObject`; absent without a grasp. A new grasp of the same hand is reached within
   * 150 ms.
   */
  handAt(clientFromObject: Rigid): HandPose | undefined {
    const hand = this.grasp?.hand && handAt(this.grasp.hand, clientFromObject);
    const t = (performance.now() - this.changedAt) / CHANGE_TIME;
    return hand && this.previous && t < 1 ? handBetween(handAt(this.previous, clientFromObject), hand, t) : hand;
  }

  /** Ends the track. */
  async close(): Promise<void> {
    this.isOpen = false;
    this.next = undefined;
    await this.sending;
    if (this.name) {
      await this.client.grasps.deleteTrack({ name: this.name });
      this.name = "";
    }
  }

  private async send(): Promise<void> {
    while (this.next && this.isOpen) {
      const frame = this.next;
      const isFirst = !this.name;
      this.next = undefined;
      try {
        this.name ||= await this.begin();
        this.sequence += 1n;
        this.take(await this.client.grasps.pushFrame({ ...frame, track: this.name, sequence: this.sequence }));
      } catch (caught) {
        const error = ConnectError.from(caught);
        if (error.code === Code.NotFound && !isFirst) {
          // The track ended because no frames came: this one begins another, with the grasp that is held.
          this.name = "";
          this.next ??= frame;
        } else {
          this.events.onError?.(error);
          // A server that is away or busy is not called for every picture.
          await new Promise((done) => setTimeout(done, retryDelay(error) ?? PAUSE));
        }
      }
    }
  }

  private async begin(): Promise<string> {
    const current = this.grasp?.hand;
    return (await this.client.grasps.createTrack(current ? { ...this.track, current } : this.track)).name;
  }

  private take(answer: TrackAnswer): void {
    // An overtaken frame has no report.
    if (answer.current) {
      const [before, { status }] = [this.status, answer.current];
      const wasShown = this.grasp?.hand;
      this.grasp = answer.grasp && this.whole(answer.grasp);
      this.status = status;
      const changes = status !== CurrentGraspStatus.KEPT;
      if (changes) {
        const isSameHand = wasShown?.handedness === this.grasp?.hand?.handedness && wasShown?.rig === this.grasp?.hand?.rig;
        this.previous = isSameHand ? wasShown : undefined;
        this.changedAt = performance.now();
      }
      if (before !== status || (changes && this.grasp)) {
        this.events.onStatus?.(status, answer.current);
      }
    }
    this.events.onAnswer?.(answer);
  }

  /** A grasp with what `changesOnly` left out, from the answer before: it is the same at the object. */
  private whole(grasp: Grasp): Grasp {
    const before = this.grasp;
    if (grasp.contacts.length > 0 || !before?.hand || !grasp.hand) {
      return grasp;
    }
    const clientFromObject = compose(rigid(grasp.hand.clientFromWrist), inverse(rigid(grasp.hand.objectFromWrist)));
    const kept = { ...before, hand: handAt(before.hand, clientFromObject) };
    return grasp.score === undefined ? kept : { ...kept, score: grasp.score };
  }
}
