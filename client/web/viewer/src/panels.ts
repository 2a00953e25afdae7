/** The bars: what is shown above, tools at the left, the answer at the right. */
import type { App } from "./app";
import { answerPanel } from "./answer";
import { button, byId, choice, copy, element, select } from "./dom";
import type { Mode, Target } from "./gizmos";
import { HOLDOUTS, stateFor } from "./state";
import { objectName } from "./words";

export interface Menu {
  label: string;
  title: string;
  items: [string, string, () => void][];
}

/** Entries of the menus in the bar above, and sections of the panel at the right. */
export interface Parts {
  menus: Menu[];
  sections: HTMLElement[];
  /** A further button. */
  extra: HTMLElement;
  addFile: () => void;
}

export function showPanels(app: App, parts: Parts): void {
  showTop(app, parts);
  showTools(app);
  const side = byId("side");
  const answered = element("div", { id: "answered" });
  side.append(answered, giverSection(app), ...parts.sections);
  app.onAnswer.push(() => app.answer && answered.replaceChildren(...answerPanel(app.answer, () => void app.find())));
}

function showTop(app: App, parts: Parts): void {
  const objects = element("span");
  const holdouts = element("span");
  const rigs = element("span");
  const undo = button("↶", () => app.store.undo(), { title: "Undo (Ctrl+Z)", "aria-label": "Undo", id: "undo" });
  const redo = button("↷", () => app.store.redo(), { title: "Redo (Ctrl+Shift+Z)", "aria-label": "Redo", id: "redo" });
  const show = () => {
    const { state } = app;
    const names = app.objects.map(({ name }) => [name, objectName(name)] as [string, string]);
    objects.replaceChildren(select(names, state.object, (name) => app.open(stateFor(name)), { id: "object" }));
    const held = HOLDOUTS.filter(({ state: { object } }) => object === state.object).map(({ name }) => [name, name.replace(/^[a-z]+-/, "")] as [string, string]);
    const none: [string, string] = ["", held.length > 0 ? "nobody" : "own"];
    holdouts.replaceChildren(
      select([...held, none], state.giver ? state.holdout : "", (name) => {
        const found = HOLDOUTS.find((holdout) => holdout.name === name);
        app.open(found ? { ...structuredClone(found.state), receiver: state.receiver, rig: state.rig } : { ...state, giver: null, holdout: "" });
      }, { id: "holdout" }),
    );
    const own = app.rigs.all.filter(({ name }) => name !== "rigs/thesis").map(({ name }) => [name, name.replace(/^rigs\//, "")] as [string, string]);
    rigs.replaceChildren(
      ...(own.length > 1 ? [select(own, state.rig || "rigs/adult", (rig) => app.store.edit({ rig }, "find"), { id: "rig" })] : []),
      choice([["", "Either"], ["left", "Left"], ["right", "Right"]], state.receiver, (receiver) => app.store.edit({ receiver }, "find")),
    );
    rigs.className = "row";
    undo.disabled = !app.store.canUndo;
    redo.disabled = !app.store.canRedo;
  };
  app.onState.push(show);
  app.onObject.push(show);
  byId("top").append(
    element("h1", {}, "Grasp"),
    element("label", { class: "field" }, "Object", objects),
    element("label", { class: "field" }, "Held as", holdouts),
    element("span", { class: "field dim" }, "Taken by"),
    rigs,
    button("Add file…", parts.addFile, { id: "add", title: "Or drop it on the page: OBJ, STL, PLY, GLB; VRM or GLB hands; recordings" }),
    element("span", { class: "space" }),
    undo,
    redo,
    ...parts.menus.map((menu) => menuOf(menu)),
    parts.extra,
    button("Copy link", () => copy(location.href, "the link"), { id: "link" }),
  );
}

function menuOf({ label, title, items }: Menu): HTMLElement {
  const made = select(
    [["", label], ...items.map(([value, text]) => [value, text] as [string, string])],
    "",
    (value) => {
      items.find(([item]) => item === value)?.[2]();
      made.value = "";
    },
    { title, id: label.toLowerCase().replaceAll(/[^a-z]/g, "") },
  );
  return made;
}

function showTools(app: App): void {
  const targets: [Target, string, string][] = [["object", "Object", "1"], ["giver", "Giver", "2"], ["both", "Both", "3"]];
  const modes: [Mode, string, string][] = [["translate", "Move", "W"], ["rotate", "Turn", "E"], ["scale", "Size", "R"]];
  const tool = (text: string, key: string, act: () => void, id: string) => {
    const made = button(text, act, { id });
    if (key) made.append(element("kbd", {}, key));
    return made;
  };
  const targetButtons = targets.map(([target, text, key]) => tool(text, key, () => app.gizmos.select(app.gizmos.selected === target ? null : target), `target-${target}`));
  const modeButtons = modes.map(([mode, text, key]) => tool(text, key, () => app.gizmos.use(mode), `mode-${mode}`));
  const people = tool("People", "P", () => app.view.show({ people: !app.view.shown.people }, app.state), "people");
  const marks = tool("Forces", "C", () => app.view.show({ marks: !app.view.shown.marks }, app.state), "marks");
  const actions: Record<string, () => void> = {
    ...Object.fromEntries(targets.map(([target, , key]) => [key, () => app.gizmos.select(target)])),
    ...Object.fromEntries(modes.map(([mode, , key]) => [key.toLowerCase(), () => app.gizmos.use(mode)])),
    f: () => app.frame("hands"),
    h: () => app.frame("people", true),
    p: () => people.click(),
    c: () => marks.click(),
    escape: () => app.gizmos.select(null),
  };
  byId("tools").append(
    ...targetButtons,
    element("hr"),
    ...modeButtons,
    element("hr"),
    tool("Frame", "F", () => app.frame("hands"), "frame"),
    tool("All", "H", () => app.frame("people", true), "frame-all"),
    people,
    marks,
  );
  const show = () => {
    for (const [i, [target]] of targets.entries()) targetButtons[i]!.setAttribute("aria-pressed", String(app.gizmos.selected === target));
    for (const [i, [mode]] of modes.entries()) modeButtons[i]!.setAttribute("aria-pressed", String(app.gizmos.selected !== null && app.gizmos.mode === mode));
    targetButtons[1]!.disabled = targetButtons[2]!.disabled = !app.state.giver;
    people.setAttribute("aria-pressed", String(app.view.shown.people));
    marks.setAttribute("aria-pressed", String(app.view.shown.marks));
  };
  for (const toggle of [people, marks]) toggle.addEventListener("click", show);
  app.onState.push(show);
  addEventListener("keydown", (event) => {
    const isTyping = event.target instanceof Element && event.target.closest("input[type=text], input[type=number], dialog");
    if (isTyping) return;
    const key = event.key.toLowerCase();
    if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y")) {
      event.preventDefault();
      if (key === "y" || event.shiftKey) app.store.redo();
      else app.store.undo();
    } else if (!event.ctrlKey && !event.metaKey && !event.altKey && !(event.target instanceof HTMLSelectElement)) {
      actions[key]?.();
    }
  });
}

/** The slider that opens and closes the giver's fingers. */
function giverSection(app: App): HTMLElement {
  const slider = element("input", { type: "range", min: "-1", max: "1", step: "0.01", value: "0", id: "fingers" });
  const words = element("span", { class: "dim" });
  slider.addEventListener("input", () => app.state.giver && app.store.drag({ giver: { ...app.state.giver, open: Number(slider.value) } }));
  slider.addEventListener("change", () => {
    app.store.end();
    app.onState.forEach((show) => show());
  });
  const section = element("section", {}, element("h2", {}, "Giver's fingers", words), slider);
  app.onState.push(() => {
    const { giver } = app.state;
    section.hidden = !giver;
    if (!giver) return;
    slider.value = String(giver.open);
    words.textContent = giver.open === 0 ? "as held" : giver.open > 0 ? `${Math.round(100 * giver.open)} % open` : `${Math.round(-100 * giver.open)} % closed`;
  });
  return section;
}
