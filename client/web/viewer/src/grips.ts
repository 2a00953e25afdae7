/** The list of grips: the best that differ, with pictures, to choose, prefer or ban. */
import { Vector3 } from "three";

import type { Grasp } from "#contract/grasp_pb";
import { DifferBy, type FindGraspResponse } from "#contract/grasp_service_pb";
import { Preference } from "#contract/object_service_pb";
import type { App } from "./app";
import * as api from "./api";
import { button, element, select, toast } from "./dom";
import { Hand, RECEIVER } from "./hands";
import { jointsOf, sideOf } from "./kinematics";
import { removeGrip, setGrip } from "./own";
import { wireReceiver } from "./state";
import { handName, objectName, sideOfObject, typeName } from "./words";

/** How many grips are listed per hand, and how long they are searched, in milliseconds. */
const COUNT = 12;
const BUDGET = 700;

interface Grip {
  name: string;
  grasp: Grasp;
  picture: HTMLCanvasElement | null;
}

export class Grips {
  readonly section = element("section", { id: "grips" });
  private grips: Grip[] = [];
  private readonly list = element("div", { class: "grips" });
  private readonly known = element("ul", { class: "plain" });
  private readonly filters = element("div", { class: "row wrap", style: "margin: 8px 0" });
  private readonly filter = { type: "", side: "", hand: "", sort: "score" };
  private readonly hand: Hand;
  private chosen: string | null = null;

  constructor(private readonly app: App) {
    this.hand = new Hand("thumbnail", RECEIVER, app.rigs.adult.bind(app.rigs));
    this.hand.group.visible = false;
    app.stage.content.add(this.hand.group);
    const search = button("Find grips", () => void this.search(search), { class: "small", id: "find-grips" });
    this.section.append(element("h2", {}, "Grips", search), this.filters, this.list, this.known);
    app.onObject.push(() => this.showKnown());
    app.onState.push(() => {
      const object = app.state.object;
      if (object !== this.of && !object.startsWith(`${this.of}-own`)) this.forget();
      this.of = object;
    });
  }

  private of = "";

  private forget(): void {
    this.grips = [];
    this.chosen = null;
    this.show();
    this.showKnown();
  }

  /** Searches grips of the shown holdout, by either hand if none is chosen. */
  private async search(asked: HTMLButtonElement): Promise<void> {
    const { app } = this;
    asked.disabled = true;
    asked.textContent = "Searching…";
    try {
      const { receiver } = app.state;
      const sides = receiver ? [receiver] : (["right", "left"] as const);
      const answers: FindGraspResponse[] = [];
      for (const side of sides) {
        answers.push(
          ...(await api.stream({
            holdout: app.holdout(),
            receiver: wireReceiver({ ...app.state, receiver: side }),
            search: { budget: { seconds: 0n, nanos: BUDGET * 1e6 } },
            output: { keyFrames: true },
            sent: { case: "alternatives", value: { count: COUNT, differBy: [DifferBy.APPROACH, DifferBy.TYPE] } },
          })),
        );
      }
      const seen = new Map<string, number>();
      this.grips = answers.flatMap(({ grasps: [grasp] }) => {
        if (!grasp?.hand) return [];
        const base = `${typeName(grasp.type)} ${sideOf(grasp.hand.handedness)} ${sideOfObject(grasp)}`.toLowerCase().replaceAll(" ", "-");
        const number = (seen.get(base) ?? 0) + 1;
        seen.set(base, number);
        return [{ name: number === 1 ? base : `${base}-${number}`, grasp, picture: null }];
      });
      this.chosen = null;
      this.show();
      for (const grip of this.grips) {
        await this.draw(grip);
        // The page stays responsive between pictures.
        await new Promise((resolve) => setTimeout(resolve));
      }
      if (this.grips.length === 0) toast("No grips were found", "bad");
    } catch (error) {
      toast(api.inWords(error), "bad");
    } finally {
      asked.disabled = false;
      asked.textContent = "Find grips";
    }
  }

  private async draw(grip: Grip): Promise<void> {
    const { app } = this;
    const { hand } = grip.grasp;
    const rig = hand && app.rigs.get(hand.rig, sideOf(hand.handedness));
    if (!hand || !rig) return;
    const joints = jointsOf(hand);
    await this.hand.pose(rig, joints, hand.scale ?? 1, null);
    const center = new Vector3(...app.state.pose.p);
    // From the thumb's side, and from above.
    const back = new Vector3().setFromMatrixColumn(joints[0]!, 1);
    const wrist = new Vector3().setFromMatrixPosition(joints[1]!);
    const thumb = new Vector3().setFromMatrixColumn(joints[0]!, 0).multiplyScalar(rig.side === "right" ? -1 : 1);
    const from = thumb.addScaledVector(back, 0.25).add(new Vector3(0, 0.4, 0));
    const middle = wrist.clone().lerp(center, 0.6);
    const radius = Math.max(0.09, wrist.distanceTo(center) * 0.75);
    grip.picture = app.stage.snapshot(200, 150, middle, radius, from, [app.view.object.mesh, this.hand.group]);
    this.hand.group.visible = false;
    this.show();
  }

  private options(of: (grasp: Grasp) => string): string[] {
    return [...new Set(this.grips.map(({ grasp }) => of(grasp)))].sort();
  }

  private show(): void {
    const { filter } = this;
    const hand = (grasp: Grasp) => handName(grasp.hand!.handedness);
    const by = (key: "type" | "side" | "hand", all: string, values: string[]) =>
      select([["", all], ...values.map((value) => [value, value] as [string, string])], filter[key], (value) => {
        filter[key] = value;
        this.show();
      }, { class: "small", id: `filter-${key}` });
    this.filters.replaceChildren(
      ...(this.grips.length > 1
        ? [
            by("type", "All types", this.options((grasp) => typeName(grasp.type))),
            by("side", "All sides", this.options(sideOfObject)),
            by("hand", "Both hands", this.options(hand)),
            select([["score", "By score"], ["type", "By type"]], filter.sort, (value) => {
              filter.sort = value;
              this.show();
            }),
          ]
        : []),
    );
    const shown = this.grips
      .filter(({ grasp }) => (!filter.type || typeName(grasp.type) === filter.type) && (!filter.side || sideOfObject(grasp) === filter.side) && (!filter.hand || hand(grasp) === filter.hand))
      .sort((a, b) => (filter.sort === "type" ? typeName(a.grasp.type).localeCompare(typeName(b.grasp.type)) : 0) || (b.grasp.score ?? 0) - (a.grasp.score ?? 0));
    this.list.replaceChildren(...shown.map((grip) => this.card(grip)));
  }

  private card(grip: Grip): HTMLElement {
    const { grasp, name } = grip;
    const known = this.app.object?.knownGrips.find((known) => known.name === name)?.preference;
    const mark = (text: string, kind: string, preference: Preference) =>
      button(text, () => void this.mark(grip, known === preference ? null : preference), { class: kind, "aria-pressed": String(known === preference) });
    const card = element(
      "div",
      { class: `grip${this.chosen === name ? " chosen" : ""}`, title: name },
      grip.picture ?? element("canvas", { width: 200, height: 150 }),
      element("div", { class: "text" }, element("b", {}, typeName(grasp.type)), element("span", { class: "dim" }, `${(grasp.score ?? 0).toFixed(2)}, ${sideOf(grasp.hand!.handedness)}, ${sideOfObject(grasp)}`)),
      element("div", { class: "row" }, mark("Prefer", "prefer", Preference.PREFERRED), mark("Ban", "ban", Preference.FORBIDDEN)),
    );
    card.querySelector("canvas")!.onclick = () => {
      this.chosen = name;
      this.app.choose(grasp);
      this.show();
    };
    return card;
  }

  private async mark({ name, grasp }: Grip, preference: Preference | null): Promise<void> {
    try {
      await setGrip(this.app, name, grasp.hand!, preference);
      this.show();
      await this.app.find();
    } catch (error) {
      toast(api.inWords(error), "bad");
    }
  }

  /** The grips that are kept with the object. */
  private showKnown(): void {
    const { object } = this.app;
    const grips = object?.knownGrips ?? [];
    this.known.replaceChildren(
      ...(grips.length > 0 ? [element("li", { class: "dim", style: "margin-top: 8px" }, `Kept with ${objectName(object!.name)}`)] : []),
      ...grips.map((grip) =>
        element(
          "li",
          { class: "row" },
          element("span", { class: `pill ${grip.preference === Preference.PREFERRED ? "good" : "bad"}` }, grip.preference === Preference.PREFERRED ? "preferred" : "banned"),
          element("span", { class: "grow" }, grip.name),
          button("×", () => void removeGrip(this.app, grip).then(() => {
            this.show();
            return this.app.find();
          }), { class: "small", title: "Remove" }),
        ),
      ),
    );
  }
}
