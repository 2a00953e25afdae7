/** The handover on the stage: object, hands, people and marks. */
import { Box3, Group, Matrix4, Raycaster, Sphere, Vector2, Vector3 } from "three";

import { Check, type Grasp } from "#contract/grasp_pb";
import type { HandPose } from "#contract/holdout_pb";
import { GIVER, Hand, RECEIVER } from "./hands";
import { type Angles, digitsOf, jointsOf, sideOf, WRIST } from "./kinematics";
import { Marks, nearest } from "./marks";
import type { ModelHands } from "./models";
import { HeldObject, type ObjectMesh } from "./object";
import { Person } from "./people";
import { matrix, type Pose, vector } from "./poses";
import type { Rigs } from "./rigs";
import { HELD_HEIGHT, type Stage } from "./stage";
import { type Giver, givenDigits, type State } from "./state";

/** What of the handover is shown. */
export interface Shown {
  people: boolean;
  marks: boolean;
}

export class View {
  readonly object = new HeldObject();
  readonly giver: Hand;
  readonly receiver: Hand;
  readonly before: Hand;
  readonly marks = new Marks();
  readonly people: { giver: Person; receiver: Person };
  readonly shown: Shown = { people: true, marks: true };
  private readonly all = new Group();
  private grasp: Grasp | null = null;
  private hasGiver = false;
  private settled: Promise<void> = Promise.resolve();

  constructor(
    readonly stage: Stage,
    private readonly rigs: Rigs,
    readonly models: ModelHands,
  ) {
    const adult = rigs.adult.bind(rigs);
    this.giver = new Hand("giver", GIVER, adult);
    this.receiver = new Hand("receiver", RECEIVER, adult);
    this.before = new Hand("before", { ...RECEIVER, skin: ["#7fb4ff", "#7fb4ff", "#7fb4ff"] }, adult);
    this.before.fade(true);
    const ground = () => this.stage.ground.position.y;
    this.people = { giver: new Person("giver", GIVER, 1, ground), receiver: new Person("receiver", RECEIVER, -1, ground) };
    this.all.add(this.object.group, this.giver.group, this.receiver.group, this.before.group, this.models.group);
    this.all.add(this.people.giver.group, this.people.receiver.group, this.marks.between);
    this.object.group.add(this.marks.atObject);
    this.before.group.visible = this.receiver.group.visible = false;
    stage.content.add(this.all);
  }

  showObject(mesh: ObjectMesh): void {
    this.object.show(mesh);
    this.stage.draw();
  }

  /** Puts the ground and the people below and around a new scene. */
  settle(state: State): void {
    this.stage.ground.position.y = state.pose.p[1] - HELD_HEIGHT;
    this.people.giver.leave();
    this.people.receiver.leave();
    this.stage.lightAt(new Vector3(...state.pose.p));
  }

  showState(state: State): void {
    const { group } = this.object;
    group.matrixAutoUpdate = false;
    group.matrix.copy(matrix(state.pose)).scale(new Vector3(state.scale, state.scale, state.scale));
    group.matrixWorldNeedsUpdate = true;
    this.marks.atObject.scale.setScalar(1 / state.scale);
    this.showGiver(state.giver);
  }

  showGiver(giver: Giver | null): void {
    const rig = giver && this.rigs.get(giver.rig, giver.side);
    if (!giver || !rig) {
      this.showGivenJoints(null);
      return;
    }
    const joints = rig.joints(matrix(giver.wrist), giver.scale, givenDigits(giver, rig));
    this.showGivenJoints(joints, giver);
  }

  /** Shows the giver's hand by its joints, as a headset tracks them. */
  showGivenJoints(joints: (Matrix4 | null)[] | null, giver?: Pick<Giver, "rig" | "side" | "scale">): void {
    this.hasGiver = joints !== null;
    this.giver.group.visible = this.hasGiver;
    this.people.giver.group.visible = this.hasGiver && this.shown.people;
    if (joints && giver) {
      const person = this.people.giver;
      person.reach(giver.side, joints[WRIST]!);
      const rig = this.rigs.get(giver.rig, giver.side) ?? this.rigs.adult(giver.side);
      this.later(this.giver.pose(rig, joints, giver.scale, this.shown.people ? person.elbow : null));
    }
    this.stage.draw();
  }

  /** Shows the receiving hand of an answer; `null`: without one, the last hand fades. */
  showGrasp(grasp: Grasp | null, state: State): void {
    this.grasp = grasp;
    const hand = grasp?.hand;
    this.receiver.fade(!grasp);
    this.marks.show(this.shown.marks ? grasp : null);
    if (grasp && hand) this.showHand(hand, grasp, state);
    this.showClearance();
    this.stage.draw();
  }

  /** Hides the receiver, as for a new object. */
  clear(): void {
    this.grasp = null;
    this.receiver.group.visible = this.people.receiver.group.visible = this.marks.between.visible = false;
    this.models.hide();
    this.marks.show(null);
    this.stage.draw();
  }

  private showHand(hand: HandPose, grasp: Grasp, state: State): void {
    const joints = jointsOf(hand);
    const side = sideOf(hand.handedness);
    const rig = this.rigs.get(hand.rig, side);
    if (!rig || joints.length === 0) return;
    const person = this.people.receiver;
    person.group.visible = this.shown.people;
    const { arm } = grasp;
    if (arm) person.follow(side, joints[WRIST]!, vector(arm.clientElbow));
    else person.reach(side, joints[WRIST]!);
    const elbow = this.shown.people ? person.elbow : null;
    this.later(this.receiver.pose(rig, joints, hand.scale ?? 1, elbow).then(() => {
      this.receiver.group.visible = !this.models.show(hand);
    }));
  }

  /** Shows the receiving hand on its way, without contacts. */
  showOnTheWay(hand: HandPose, wrist: Pose, digits: Angles[]): void {
    const rig = this.rigs.get(hand.rig, sideOf(hand.handedness));
    if (!rig) return;
    const joints = rig.joints(matrix(wrist), hand.scale ?? 1, digits);
    const person = this.people.receiver;
    person.bendTo(joints[WRIST]!);
    this.marks.show(null);
    this.marks.between.visible = false;
    this.later(this.receiver.pose(rig, joints, hand.scale ?? 1, this.shown.people ? person.elbow : null));
    this.models.hide();
    this.receiver.group.visible = true;
    this.stage.draw();
  }

  /** Keeps the grasp as a ghost, to compare with; `null` removes it. */
  showBefore(hand: HandPose | null): void {
    this.before.group.visible = hand !== null;
    const rig = hand && this.rigs.get(hand.rig, sideOf(hand.handedness));
    if (hand && rig) {
      const joints = rig.joints(jointsOf(hand)[WRIST]!, hand.scale ?? 1, digitsOf(hand));
      this.later(this.before.pose(rig, joints, hand.scale ?? 1, null));
    }
    this.stage.draw();
  }

  show(shown: Partial<Shown>, state: State): void {
    Object.assign(this.shown, shown);
    this.people.receiver.group.visible = this.shown.people && this.receiver.group.visible;
    this.showState(state);
    this.showGrasp(this.grasp, state);
  }

  private showClearance(): void {
    const measured = this.grasp?.margins.find((margin) => margin.check === Check.GIVER_CLEARANCE)?.value;
    const isShown = this.shown.marks && this.hasGiver && this.grasp !== null && measured !== undefined;
    this.marks.clearance(isShown ? nearest(this.giver, this.receiver) : null, measured);
  }

  /** Loads of skins are awaited, and drawn when they are there. */
  private later(work: Promise<void>): void {
    this.settled = Promise.all([this.settled, work]).then(() => {
      this.showClearance();
      this.stage.draw();
    });
  }

  /** Completes when everything is on the stage. */
  whenSettled(): Promise<void> {
    return this.settled;
  }

  /** A ball around object and hands, or around the people. */
  bounds(what: "hands" | "people"): Sphere {
    const box = new Box3();
    if (what === "people") {
      for (const person of Object.values(this.people)) if (person.group.visible) box.expandByObject(person.group);
      if (!box.isEmpty()) return shrunk(box.getBoundingSphere(new Sphere()), 0.92);
    }
    box.expandByObject(this.object.mesh);
    for (const hand of [this.giver, this.receiver]) {
      if (!hand.group.visible) continue;
      for (const joint of hand.joints) if (joint) box.expandByPoint(new Vector3().setFromMatrixPosition(joint));
    }
    return box.getBoundingSphere(new Sphere());
  }

  /** What is at a point of the screen, from -1 to 1. */
  pick(point: Vector2): "object" | "giver" | null {
    const ray = new Raycaster();
    ray.setFromCamera(point, this.stage.camera);
    const targets = [this.object.mesh, ...(this.giver.mesh && this.giver.group.visible ? [this.giver.mesh] : [])];
    this.giver.mesh?.computeBoundingSphere();
    const [hit] = ray.intersectObjects(targets, false);
    return !hit ? null : hit.object === this.object.mesh ? "object" : "giver";
  }
}

const shrunk = (sphere: Sphere, factor: number) => new Sphere(sphere.center, sphere.radius * factor);
