/** Follows a moving holdout: one track, whose frames are answered one at a time, the latest first. */
import type { MessageInitShape } from "@bufbuild/protobuf";

import type { CurrentGraspReport, Grasp } from "#contract/grasp_pb";
import type { HandPose, HoldoutSchema } from "#contract/holdout_pb";
import * as api from "./api";
import type { wireReceiver } from "./state";

export interface Followed {
  grasp: Grasp | null;
  current: CurrentGraspReport | undefined;
  warnings: string[];
  serverMs: number;
  roundTripMs: number;
}

type Holdout = MessageInitShape<typeof HoldoutSchema> & { object: string; scale?: number | undefined };
type Receiver = ReturnType<typeof wireReceiver>;

export class Follower {
  private track: string | null = null;
  private sequence = 0n;
  private isBusy = false;
  private next: Holdout | null = null;
  private current: HandPose | undefined;
  private receiver: Receiver = { rig: "" };
  private generation = 0;
  private tracked: { object: string; scale: number | undefined } = { object: "", scale: undefined };

  constructor(
    private readonly answered: (answer: Followed) => void,
    private readonly failed: (error: unknown) => void,
  ) {}

  /** Begins anew with a grasp to hold on to. */
  begin(current: HandPose | undefined, receiver: Receiver): void {
    this.end();
    this.current = current;
    this.receiver = receiver;
  }

  /** Ends the track. */
  end(): void {
    this.generation++;
    this.drop();
    this.next = null;
  }

  private drop(): void {
    if (this.track) api.grasps.deleteTrack({ name: this.track }).catch(() => undefined);
    this.track = null;
  }

  /** Asks for the grasp of a holdout; of several while an answer is awaited, the last counts. */
  push(holdout: Holdout): void {
    this.next = holdout;
    if (!this.isBusy) void this.work();
  }

  private async work(): Promise<void> {
    this.isBusy = true;
    try {
      while (this.next) {
        const holdout = this.next;
        const { generation } = this;
        this.next = null;
        const answer = await this.answer(holdout);
        if (generation !== this.generation || !answer) continue;
        this.answered(answer);
      }
    } catch (error) {
      this.track = null;
      this.failed(error);
    } finally {
      this.isBusy = false;
    }
  }

  private async answer(holdout: Holdout, isAgain = false): Promise<Followed | null> {
    const { generation } = this;
    const { object, scale } = holdout;
    // A track keeps object and size.
    if (this.track && (object !== this.tracked.object || scale !== this.tracked.scale)) this.drop();
    if (!this.track) {
      this.tracked = { object, scale };
      const created = await api.grasps.createTrack({
        holdout: { object, ...(scale === undefined ? {} : { scale }) },
        receiver: this.receiver,
        ...(this.current && { current: this.current }),
        mayChangeHand: true,
        output: { keyFrames: true },
      });
      if (generation !== this.generation) {
        api.grasps.deleteTrack({ name: created.name }).catch(() => undefined);
        return null;
      }
      this.track = created.name;
      this.sequence = 0n;
    }
    const frame: Holdout = { ...holdout, object: "", scale: undefined };
    try {
      const captureTime = { seconds: BigInt(Math.floor(performance.now() / 1000)), nanos: Math.floor((performance.now() % 1000) * 1e6) };
      const pushed = api.grasps.pushFrame({ track: this.track, sequence: ++this.sequence, captureTime, holdout: frame });
      const [answer, roundTripMs] = await api.timed(pushed);
      if (answer.grasp?.hand) this.current = answer.grasp.hand;
      const time = answer.serverTime;
      return {
        grasp: answer.grasp ?? null,
        current: answer.current,
        warnings: answer.warnings,
        serverMs: time ? 1000 * Number(time.seconds) + time.nanos / 1e6 : 0,
        roundTripMs,
      };
    } catch (error) {
      // Tracks end when nothing moves for a while.
      if (isAgain || !api.isGone(error)) throw error;
      this.track = null;
      return this.answer(holdout, true);
    }
  }
}
