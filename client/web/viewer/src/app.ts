/** The page's parts and how they work together: a change of the state asks the server, its answer goes to stage and panels. */
import { Outcome, type Grasp } from "#contract/grasp_pb";
import type { FindGraspRequestSchema } from "#contract/grasp_service_pb";
import type { GraspObject } from "#contract/object_service_pb";
import type { MessageInitShape } from "@bufbuild/protobuf";
import type { Answer } from "./answer";
import * as api from "./api";
import { toast } from "./dom";
import { Follower } from "./follow";
import { Gizmos } from "./gizmos";
import { ModelHands } from "./models";
import { meshOf } from "./object";
import type { Opening } from "./opening";
import type { Rigs } from "./rigs";
import type { Stage } from "./stage";
import { type Change, findRequest, fromHash, type Giver, type State, stateFor, Store, toHash, wireHoldout, wireReceiver } from "./state";
import { View } from "./view";
import { Vector3 } from "three";

/** Where the camera stands at first, seen from the object; on the other side if the receiver's arm is there. */
const FROM = new Vector3(0.8, 0.56, 0.24);

export class App {
  readonly rigs: Rigs;
  readonly models = new ModelHands();
  readonly store: Store;
  readonly view: View;
  readonly gizmos: Gizmos;
  readonly follower: Follower;
  objects: GraspObject[] = [];
  answer: Answer | null = null;
  /** Panels, to show what has changed. */
  readonly onAnswer: (() => void)[] = [];
  readonly onState: (() => void)[] = [];
  readonly onObject: (() => void)[] = [];
  /** Milliseconds from opening the page to the first grasp on the screen. */
  firstGraspMs: number | null = null;
  private searches = 0;
  private shownObject = "";
  /** The scene is new: the camera looks at it once object and answer are there. */
  private isNew = true;
  private isMeshShown = false;
  private hashTimer = 0;

  constructor(
    readonly stage: Stage,
    private readonly opening: Opening,
  ) {
    this.rigs = opening.rigs;
    this.store = new Store(opening.state, (change) => this.changed(change));
    this.view = new View(stage, this.rigs, this.models);
    this.gizmos = new Gizmos(stage, () => this.store, () => this.onState.forEach((show) => show()));
    this.follower = new Follower(
      (followed) =>
        this.show({
          ...followed,
          outcome: followed.grasp ? Outcome.FOUND : Outcome.BUDGET_EXHAUSTED,
        }),
      (error) => toast(api.inWords(error), "bad"),
    );
    addEventListener("hashchange", () => {
      const linked = fromHash(location.hash);
      if (linked && toHash(linked) !== toHash(this.store.state)) this.open(linked);
    });
  }

  get state(): State {
    return this.store.state;
  }

  get object(): GraspObject | undefined {
    return this.objects.find(({ name }) => name === this.state.object);
  }

  async start(): Promise<void> {
    const asked = this.find(this.opening.found);
    try {
      [this.objects] = await Promise.all([this.opening.objects, this.opening.rigsLoaded]);
    } catch (error) {
      toast(api.inWords(error), "bad");
      return;
    }
    if (!this.object) {
      toast(`${this.state.object} is not on this server`, "bad");
      this.open(stateFor(this.objects[0]?.name ?? "objects/remote"));
      return;
    }
    this.view.settle(this.state);
    this.view.showState(this.state);
    this.onState.forEach((show) => show());
    await Promise.all([this.showObject(), asked]);
  }

  async refreshObjects(): Promise<void> {
    this.objects = await api.allObjects();
    this.onObject.forEach((show) => show());
  }

  /** Opens another scene: its people come anew, and the camera looks at it. */
  open(state: State): void {
    this.view.clear();
    this.answer = null;
    this.view.settle(state);
    this.isNew = true;
    this.store.set(state, "find");
    this.gizmos.select(null);
  }

  rigOf = (giver: Giver) => this.rigs.get(giver.rig, giver.side);

  /** The holdout as the contract has it. */
  holdout() {
    return wireHoldout(this.state, this.rigOf);
  }

  /** The request for the grasp that is shown. */
  request(): MessageInitShape<typeof FindGraspRequestSchema> {
    return findRequest(this.state, this.rigOf);
  }

  async find(call = api.find(this.request())): Promise<void> {
    const search = ++this.searches;
    this.follower.end();
    try {
      const [found, roundTripMs] = await call;
      await this.opening.rigsLoaded;
      if (search !== this.searches) return;
      const time = found.report?.searchTime;
      this.show({
        outcome: found.outcome,
        grasp: found.grasps[0] ?? null,
        report: found.report,
        origin: found.origin,
        warnings: found.report?.warnings ?? [],
        serverMs: time ? 1000 * Number(time.seconds) + time.nanos / 1e6 : 0,
        roundTripMs,
      });
      this.follower.begin(found.grasps[0]?.hand, wireReceiver(this.state));
    } catch (error) {
      toast(api.inWords(error), "bad");
    }
  }

  /** Asks to hold on to the present grasp. */
  follow(): void {
    this.searches++;
    this.follower.push(this.holdout());
  }

  /** Shows a grasp that was chosen, and holds on to it from now on. */
  choose(grasp: Grasp): void {
    this.searches++;
    this.show({ ...(this.answer ?? { warnings: [], serverMs: 0, roundTripMs: 0 }), outcome: Outcome.FOUND, grasp, current: undefined });
    this.follower.begin(grasp.hand, wireReceiver(this.state));
  }

  private show(answer: Answer): void {
    this.answer = answer;
    this.view.showGrasp(answer.grasp, this.state);
    this.look();
    this.onAnswer.forEach((show) => show());
    if (this.firstGraspMs === null && answer.grasp) {
      this.view.whenSettled().then(() => {
        this.stage.afterNextPicture(() => (this.firstGraspMs ??= performance.now()));
      });
    }
  }

  private changed(change: Change): void {
    this.view.showState(this.state);
    if (this.state.object !== this.shownObject) void this.showObject();
    if (change === "find") void this.find();
    else this.follow();
    this.gizmos.place();
    this.onState.forEach((show) => show());
    clearTimeout(this.hashTimer);
    this.hashTimer = window.setTimeout(() => history.replaceState(null, "", `#${toHash(this.state)}`), 250);
  }

  /** Shows the state's object, as it is on the server. */
  async showObject(): Promise<void> {
    const { object } = this.state;
    this.shownObject = object;
    this.isMeshShown = false;
    try {
      const { etag } = this.object ?? (await api.objects.getObject({ name: object }));
      const mesh = await meshOf(object, etag);
      if (this.state.object !== object) return;
      this.view.showObject(mesh);
      this.isMeshShown = true;
      this.look();
      this.onObject.forEach((show) => show());
    } catch (error) {
      toast(api.inWords(error), "bad");
    }
  }

  /** Shows object and hands, or the people, from where the camera is or from the side that nobody's arm hides. */
  frame(what: "hands" | "people", fromSide = false): void {
    const { center, radius } = this.view.bounds(what);
    const elbow = this.view.people.receiver.elbow;
    const side = elbow && elbow.x > this.state.pose.p[0] ? -1 : 1;
    this.stage.frame(center, radius, fromSide ? FROM.clone().multiply(new Vector3(side, 1, 1)) : undefined);
  }

  private look(): void {
    if (!this.isNew || !this.isMeshShown || !this.answer) return;
    this.isNew = false;
    this.frame("hands", true);
    this.stage.start();
  }
}
