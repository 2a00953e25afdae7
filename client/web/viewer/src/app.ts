/** The page's parts and how they work together: a change of the state asks the server, its answer goes to stage and panels. */
import type { MessageInitShape } from "@bufbuild/protobuf";
import { Line3, Vector3 } from "three";

import { Outcome, type Grasp } from "#contract/grasp_pb";
import type { FindGraspRequestSchema } from "#contract/grasp_service_pb";
import type { GraspObject } from "#contract/object_service_pb";
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

/** Where the camera may stand at first, seen from the object; the first place from which no body is in the way is taken. */
const FROM = [new Vector3(0.8, 0.56, 0.24), new Vector3(0.8, 0.56, -0.3), new Vector3(0.7, 1.1, 0)];

/** Distance of the camera, and the radius of a body, in meters. */
const VIEW = 0.7;
const BODY = 0.26;

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
  /** The last search. */
  finding: Promise<void> = Promise.resolve();
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
    // Shown anew even if it is the same object: its size may be another.
    this.shownObject = "";
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
    if (change === "find") this.finding = this.find();
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
    this.stage.frame(center, radius, fromSide ? this.freeSide(center) : undefined);
  }

  /** A direction in which no body hides a point, rather from the side where the receiver's arm is not. */
  private freeSide(center: Vector3): Vector3 {
    const { giver, receiver } = this.view.people;
    const side = receiver.elbow && receiver.elbow.x > this.state.pose.p[0] ? -1 : 1;
    const bodies = [giver, receiver].flatMap(({ standsAt, group }) => (standsAt && group.visible ? [standsAt] : []));
    const isFree = (from: Vector3) => {
      const end = center.clone().addScaledVector(from.clone().normalize(), VIEW);
      const way = new Line3(center.clone().setY(0), end.setY(0));
      return bodies.every((body) => way.closestPointToPoint(body.clone().setY(0), true, new Vector3()).distanceTo(body.clone().setY(0)) > BODY);
    };
    const candidates = FROM.flatMap((from) => [side, -side].map((sign) => from.clone().multiply(new Vector3(sign, 1, 1))));
    return candidates.find(isFree) ?? candidates[0]!;
  }

  private look(): void {
    if (!this.isNew || !this.isMeshShown || !this.answer) return;
    this.isNew = false;
    this.frame("hands", true);
    this.stage.start();
  }
}
