/** Before and after: keeps the shown version, whose grasp stays as a ghost, and changes between it and the present one. */
import type { HandPose } from "#contract/holdout_pb";
import type { App } from "./app";
import { button, element } from "./dom";
import { type State, toHash } from "./state";

export function compareSection(app: App): HTMLElement {
  let kept: { state: State; hand: HandPose | null } | null = null;
  const swap = button("Swap", () => {
    if (!kept) return;
    const other = kept;
    kept = { state: app.state, hand: app.answer?.grasp?.hand ?? null };
    app.view.showBefore(kept.hand);
    app.store.set(other.state, other.state.object === app.state.object ? "follow" : "find");
  }, { class: "small", id: "swap" });
  const keep = button("Keep this", () => {
    kept = kept ? null : { state: app.state, hand: app.answer?.grasp?.hand ?? null };
    app.view.showBefore(kept?.hand ?? null);
    show();
  }, { class: "small", id: "keep" });
  const words = element("span", { class: "dim grow" });
  const show = () => {
    swap.disabled = kept === null;
    keep.textContent = kept ? "Drop" : "Keep this";
    words.textContent = !kept ? "" : toHash(kept.state) === toHash(app.state) ? "unchanged" : "in blue: the kept grasp";
  };
  app.onState.push(show);
  show();
  return element("section", { id: "compare" }, element("h2", {}, "Before and after"), element("div", { class: "row" }, keep, swap, words));
}
