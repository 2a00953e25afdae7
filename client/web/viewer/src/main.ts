/** The page. */
import { Vector2 } from "three";

import { App } from "./app";
import { compareSection } from "./compare";
import { byId, copy } from "./dom";
import { downloads, isaacGrasps, sceneGlb } from "./exports";
import { Files } from "./files";
import { Grips } from "./grips";
import { Opening } from "./opening";
import { ownHandButton } from "./own_hand";
import { Painter } from "./paint";
import { showPanels } from "./panels";
import * as snippets from "./snippets";
import { Stage } from "./stage";
import { Timeline } from "./timeline";

const canvas = byId("canvas") as HTMLCanvasElement;
// Asked before the stage is set up, which takes longer than the answer.
const opening = new Opening();
const stage = new Stage(canvas);
const app = new App(stage, opening);
const timeline = new Timeline(app);
const painter = new Painter(app);
const files = new Files(app, (name, text) => timeline.open(name, text));
const code: [string, string, (app: App) => string][] = [
  ["curl", "curl", snippets.curl],
  ["grpcurl", "grpcurl", snippets.grpcurl],
  ["python", "Python", snippets.python],
  ["rust", "Rust", snippets.rust],
];
showPanels(app, {
  menus: [
    { label: "Copy as…", title: "The request as code", items: code.map(([id, name, text]) => [id, name, () => void copy(text(app), `the request as ${name}`)]) },
    { label: "Download…", title: "Scene and grasp as files", items: downloads(app) },
  ],
  sections: [new Grips(app).section, compareSection(app), painter.section],
  extra: ownHandButton(app),
  addFile: () => files.choose(),
});

// A click, not a drag, selects the thing under it.
let down: Vector2 | null = null;
canvas.addEventListener("pointerdown", (event) => (down = new Vector2(event.clientX, event.clientY)));
canvas.addEventListener("pointerup", (event) => {
  const up = new Vector2(event.clientX, event.clientY);
  if (painter.isActive || !down || down.distanceTo(up) > 4 || app.gizmos.controls.axis) return;
  const { width, height, left, top } = canvas.getBoundingClientRect();
  app.gizmos.select(app.view.pick(new Vector2((2 * (up.x - left)) / width - 1, 1 - (2 * (up.y - top)) / height)));
});

/** What tests look at. */
const tested = { app, renderer: stage.renderer, snippets, sceneGlb, isaacGrasps };
declare global {
  interface Window {
    graspViewer: typeof tested;
  }
}
window.graspViewer = tested;
void app.start();
