// Uses the viewer in a headless Chromium as a person does, and prints what it saw as JSON.
//
//   node drive.mjs URL CHROMIUM FOLDER
//
// FOLDER has block.obj, hand.glb and motion.json to drop; pictures go there.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import path from "node:path";

const puppeteer = createRequire(path.join(process.env.NODE_PATH, "none.js"))("puppeteer-core");
const [url, executablePath, folder] = process.argv.slice(2);
const SIZE = { width: 640, height: 360 };
const LARGE = { width: 1100, height: 700 };
const LONGEST = 30_000;

// Its sandbox needs rights that containers lack; it loads nothing but the page.
const options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-first-run"];
const browser = await puppeteer.launch({ executablePath, headless: true, args: options, protocolTimeout: 120_000 });
const page = await browser.newPage();
const problems = [];
const requested = new Set();
function watch(page) {
  page.on("console", (message) => ["error", "warn"].includes(message.type()) && problems.push(message.text()));
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("request", (request) => requested.add(new URL(request.url()).protocol === "blob:" ? "blob:" : new URL(request.url()).origin));
}
watch(page);

const until = (condition, ...values) => page.waitForFunction(condition, { timeout: LONGEST, polling: 50 }, ...values);
const text = (selector) => page.$eval(selector, (element) => element.textContent);
const picture = (name) => page.screenshot({ path: path.join(folder, `${name}.png`) });
const seen = {};

async function answered() {
  await until(() => document.querySelector("#outcome")?.textContent === "Found");
}

async function drop(file, type) {
  const data = readFileSync(path.join(folder, file)).toString("base64");
  await page.evaluate(
    (file, type, data) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], file, { type }));
      for (const kind of ["dragenter", "drop"]) dispatchEvent(new DragEvent(kind, { dataTransfer: transfer, bubbles: true }));
    },
    file,
    type,
    data,
  );
}

// The first grasp.
await page.setViewport(SIZE);
await page.goto(url);
await until(() => window.graspViewer?.app.firstGraspMs != null);
seen.first = await page.evaluate(() => ({ ms: graspViewer.app.firstGraspMs, calls: graspViewer.renderer.info.render.calls, triangles: graspViewer.renderer.info.render.triangles }));
Object.assign(seen.first, { outcome: await text("#outcome"), type: await text("#type"), time: await text("#ms"), contacts: await page.$$eval("#contacts tr", (rows) => rows.length) });
seen.frameMs = await page.evaluate(async () => {
  const times = [];
  for (let i = 0; i < 6; i++) {
    const start = performance.now();
    await new Promise((resolve) => graspViewer.app.stage.afterNextPicture(resolve));
    await new Promise(requestAnimationFrame);
    times.push(performance.now() - start);
  }
  return times.sort((a, b) => a - b)[3];
});
await page.setViewport(LARGE);
await picture("first");

// The page's joints of an answer's angles are those of the answer.
seen.jointsOff = await page.evaluate(() => {
  const { app } = graspViewer;
  const { hand } = app.answer.grasp;
  const digits = ["thumb", "index", "middle", "ring", "little"].map((name) => {
    const { baseYaw, basePitch, secondPitch, thirdPitch } = hand[name];
    return [baseYaw, basePitch, secondPitch, thirdPitch];
  });
  const answered = app.view.receiver.joints;
  const own = app.rigs.get(hand.rig, hand.handedness === 1 ? "left" : "right").joints(answered[1], hand.scale ?? 1, digits);
  return Math.max(...own.map((joint, i) => Math.max(...joint.elements.map((value, j) => Math.abs(value - answered[i].elements[j])))));
});

// Where the pixels of the hand are beside those of the object, drawn in two flat colors.
seen.touch = await page.evaluate(async () => {
  const { app, renderer } = graspViewer;
  const { stage, view } = app;
  await view.whenSettled();
  const Flat = view.marks.dots.material.constructor;
  const painted = [[view.object.mesh, "#ff0000"], [view.receiver.mesh, "#00ff00"]];
  const materials = painted.map(([mesh, color]) => {
    const { material } = mesh;
    mesh.material = new Flat({ color, toneMapped: false });
    return material;
  });
  const hidden = [];
  for (const root of [...stage.scene.children, ...view.all.children]) {
    const isShown = root === stage.content || root === view.object.group || root === view.receiver.group;
    if (!isShown && root.visible) {
      root.visible = false;
      hidden.push(root);
    }
  }
  view.marks.atObject.visible = false;
  // Seen from all around, so that each contact is in sight from somewhere.
  const contacts = app.answer.grasp.contacts.map(({ position }) => position);
  const touching = contacts.map(() => false);
  const { width, height } = renderer.domElement;
  const copy = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d", { willReadFrequently: true });
  const Vector = stage.camera.position.constructor;
  const { center, radius } = view.bounds("hands");
  const before = stage.camera.position.clone();
  let beside = 0;
  for (let turn = 0; turn < 8; turn++) {
    stage.frame(center, radius * 0.8, new Vector(Math.sin(turn * 0.785), turn % 2 ? 0.7 : -0.3, Math.cos(turn * 0.785)));
    stage.camera.updateMatrixWorld();
    renderer.render(stage.scene, stage.camera);
    copy.clearRect(0, 0, width, height);
    copy.drawImage(renderer.domElement, 0, 0);
    const pixels = copy.getImageData(0, 0, width, height).data;
    const kind = (x, y) => {
      const at = 4 * (Math.round(y) * width + Math.round(x));
      return pixels[at] > 200 && pixels[at + 1] < 60 ? 1 : pixels[at + 1] > 200 && pixels[at] < 60 ? 2 : 0;
    };
    for (let y = 1; y < height; y++) for (let x = 1; x < width; x++) if (kind(x, y) + kind(x - 1, y) === 3) beside++;
    for (const [index, { x, y, z }] of contacts.entries()) {
      const at = new Vector(x, y, z).applyMatrix4(view.object.group.matrixWorld).project(stage.camera);
      const [px, py] = [((at.x + 1) / 2) * width, ((1 - at.y) / 2) * height];
      const near = new Set();
      for (let dx = -9; dx <= 9; dx++) for (let dy = -9; dy <= 9; dy++) if (px + dx >= 0 && px + dx < width && py + dy >= 0 && py + dy < height) near.add(kind(px + dx, py + dy));
      touching[index] ||= near.has(1) && near.has(2);
    }
  }
  for (const [index, [mesh]] of painted.entries()) mesh.material = materials[index];
  for (const root of hidden) root.visible = true;
  view.marks.atObject.visible = true;
  stage.frame(center, radius, before.sub(center));
  return { beside, touching };
});

// The object is dragged by the gizmo's arrow; the grasp follows.
const place = () => page.evaluate(() => graspViewer.app.state.pose.p);
const start = await place();
await page.keyboard.press("1");
await page.keyboard.press("w");
await page.evaluate(() => new Promise((resolve) => graspViewer.app.stage.afterNextPicture(resolve)));
const handle = await page.evaluate(() => {
  const { stage, gizmos } = graspViewer.app;
  const { width, height, left, top } = stage.canvas.getBoundingClientRect();
  const at = gizmos.handle.position;
  // The length of an arrow, as TransformControls draws it.
  const size = (at.distanceTo(stage.camera.position) * 1.9 * Math.tan((stage.camera.fov * Math.PI) / 360) * gizmos.controls.size) / 8;
  const toScreen = (point) => {
    const projected = point.project(stage.camera);
    return [left + ((projected.x + 1) / 2) * width, top + ((1 - projected.y) / 2) * height];
  };
  // The arrow up: no other lies before it.
  const arrow = at.clone();
  arrow.y += 0.8 * size;
  const end = arrow.clone();
  end.y += 0.03;
  return { from: toScreen(arrow), to: toScreen(end) };
});
await page.mouse.move(...handle.from);
await page.mouse.move(handle.from[0] + 1, handle.from[1]);
await page.mouse.down();
for (let step = 1; step <= 5; step++) {
  await page.mouse.move(handle.from[0] + ((handle.to[0] - handle.from[0]) * step) / 5, handle.from[1] + ((handle.to[1] - handle.from[1]) * step) / 5);
}
await page.mouse.up();
await until(() => graspViewer.app.answer.current !== undefined && !graspViewer.app.follower.isBusy);
const dragged = await place();
seen.drag = { start, end: dragged, status: await text("#outcome"), grasp: await page.evaluate(() => graspViewer.app.answer.grasp?.hand?.clientFromWrist?.position ?? null) };
await picture("dragged");

// The link has the state; undo takes the motion back.
await until((y) => { try { return Math.abs(JSON.parse(atob(location.hash.slice(1).replaceAll("-", "+").replaceAll("_", "/"))).pose.p[1] - y) < 1e-4; } catch { return false; } }, dragged[1]);
const link = page.url();
await page.keyboard.down("Control");
await page.keyboard.press("z");
await page.keyboard.up("Control");
seen.undone = await place();
const second = await browser.newPage();
await second.goto(link);
await second.waitForFunction(() => window.graspViewer?.app.answer != null, { timeout: LONGEST });
seen.linked = await second.evaluate(() => graspViewer.app.state.pose.p);
await second.close();
await page.bringToFront();

// The giver opens the fingers.
await page.focus("#fingers");
for (let i = 0; i < 20; i++) await page.keyboard.press("ArrowRight");
await until(() => !graspViewer.app.follower.isBusy);
seen.fingers = { open: await page.evaluate(() => graspViewer.app.state.giver.open), status: await text("#outcome") };

// Before and after: the kept version, with a ghost of its grasp, and the one before it, changed twice.
const opened = () => page.evaluate(() => [graspViewer.app.state.giver.open, graspViewer.app.view.before.group.visible]);
await page.click("#keep");
await page.click("#undo");
const before = await opened();
await page.click("#swap");
const after = await opened();
await page.click("#swap");
seen.compare = [before, after, await opened()];
await page.click("#swap");
await page.click("#keep");
await until(() => !graspViewer.app.follower.isBusy);

// Code and files.
seen.code = await page.evaluate(() => {
  const { app, snippets } = graspViewer;
  return Object.fromEntries(["curl", "grpcurl", "python", "rust"].map((name) => [name, snippets[name](app)]));
});
seen.isaac = await page.evaluate(() => graspViewer.isaacGrasps([graspViewer.app.answer.grasp].filter(Boolean)));
seen.scene = await page.evaluate(async () => {
  const bytes = new Uint8Array(await graspViewer.sceneGlb(graspViewer.app));
  const length = new DataView(bytes.buffer).getUint32(12, true);
  const { nodes, meshes } = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + length)));
  return { magic: new TextDecoder().decode(bytes.subarray(0, 4)), names: nodes.map(({ name }) => name), meshes: meshes.length };
});

// Grips, one of which is preferred: the built-in object is copied.
await page.click("#find-grips");
await until(() => !document.querySelector("#find-grips").disabled);
seen.grips = { count: await page.$$eval(".grip", (all) => all.length), pictures: await page.$$eval(".grip canvas", (all) => all.filter((canvas) => { const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data; const shades = new Set(); for (let i = 0; i < data.length; i += 4) shades.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]); return shades.size > 50; }).length) };
await page.$eval("#grips", (section) => section.scrollIntoView());
await page.click(".grip button.prefer");
await until(() => graspViewer.app.object?.knownGrips.length === 1);
seen.grips.object = await page.evaluate(() => ({ name: graspViewer.app.object.name, builtIn: graspViewer.app.object.builtIn, preference: graspViewer.app.object.knownGrips[0].preference }));
await page.click(".grip button.ban");
await until(() => graspViewer.app.object?.knownGrips[0]?.preference === 3);
await picture("grips");

// A dropped object, and a hand.
await drop("block.obj", "model/obj");
await page.waitForSelector("#create");
await page.click("#create");
await page.waitForSelector("#close");
const report = await text("#dialog");
// 12 m: the server's warning names the unit.
await page.select("#unit", "0.01");
await until(() => Math.abs(graspViewer.app.object?.metersPerUnit - 0.01) < 1e-6);
await until((before) => document.querySelector("#dialog").textContent !== before, report);
seen.dropped = { report, object: await page.evaluate(() => graspViewer.app.state.object), warnings: await page.$$eval("#object-warnings li", (all) => all.length) };
await page.click("#close");
await answered();
await until(() => graspViewer.app.answer?.grasp);
await picture("dropped");

// Key frames of its grasp.
seen.scrub = await page.evaluate(async () => {
  const { app } = graspViewer;
  await app.view.whenSettled();
  const at = () => [...app.view.receiver.joints[1].elements.slice(12, 15)];
  const closed = at();
  const slider = document.querySelector("#scrub");
  slider.value = "0";
  slider.dispatchEvent(new Event("input"));
  await app.view.whenSettled();
  const back = at();
  slider.value = "1";
  slider.dispatchEvent(new Event("input"));
  return { closed, back, end: at() };
});

// A region is painted.
await page.$eval("#paint", (section) => section.scrollIntoView());
await page.evaluate(() => [...document.querySelectorAll("#paint .group button")].find((button) => button.textContent === "Forbid").click());
const middle = await page.evaluate(() => {
  const { stage, view } = graspViewer.app;
  view.receiver.group.visible = view.giver.group.visible = false;
  const { width, height, left, top } = stage.canvas.getBoundingClientRect();
  const at = view.object.group.position.clone().setFromMatrixPosition(view.object.group.matrixWorld).project(stage.camera);
  return [left + ((at.x + 1) / 2) * width, top + ((1 - at.y) / 2) * height];
});
await page.mouse.move(...middle);
await page.mouse.down();
await page.mouse.move(middle[0] + 4, middle[1]);
await page.mouse.up();
await page.click("#save-regions");
await until(() => graspViewer.app.object?.forbiddenTriangleCount > 0);
seen.painted = await page.evaluate(() => ({ name: graspViewer.app.object.name, forbidden: graspViewer.app.object.forbiddenTriangleCount }));
await page.evaluate(() => [...document.querySelectorAll("#paint .group button")].find((button) => button.textContent === "Off").click());

// A dropped hand is posed by its own nodes.
await drop("hand.glb", "model/gltf-binary");
await page.waitForSelector("#new-side");
await page.select("#new-side", "right");
await page.click("#create");
await until(() => graspViewer.app.state.rig !== "" && graspViewer.app.answer?.grasp?.hand?.rig === graspViewer.app.state.rig);
await page.evaluate(() => graspViewer.app.view.whenSettled());
seen.hand = await page.evaluate(() => {
  const { app } = graspViewer;
  const { hand } = app.answer.grasp;
  const Vector = app.stage.camera.position.constructor;
  app.stage.scene.updateMatrixWorld(true);
  const model = app.models.models.get(hand.rig);
  const tips = [["index-finger-tip", 10], ["thumb-tip", 5], ["wrist", 1]].map(([name, joint]) => {
    const at = new Vector().setFromMatrixPosition(model.nodes.get(name).matrixWorld);
    const { x, y, z } = hand.joints[joint].pose.position;
    return at.distanceTo(new Vector(x, y, z));
  });
  return { isShown: model.scene.visible && !app.view.receiver.group.visible, tips };
});
await picture("hand");

// A recording is played.
await drop("motion.json", "application/json");
await until(() => document.querySelector("#time").textContent.includes("motion.json"));
await until(() => Number(document.querySelector("#scrub").value) >= 1 && !graspViewer.app.follower.isBusy);
seen.recording = { object: await page.evaluate(() => graspViewer.app.state.object), status: await text("#outcome") };
await picture("recording");

// With an emulated headset, the user's own hand holds the object out.
await page.close();
const emulated = await browser.newPage();
watch(emulated);
await emulated.setViewport(SIZE);
await emulated.evaluateOnNewDocument(`${readFileSync(path.join(process.env.NODE_PATH, "iwer/build/iwer.min.js"), "utf8")}
  const device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: false });
  device.installRuntime({ forceInstall: true });
  device.primaryInputMode = "hand";
  device.hands.left.connected = false;
  device.hands.right.position.set(0.05, 1.15, -0.45);
  window.device = device;`);
await emulated.goto(url);
const inXr = (condition) => emulated.waitForFunction(condition, { timeout: LONGEST, polling: 100 });
await inXr(() => window.graspViewer?.app.firstGraspMs != null && !document.querySelector("#xr").hidden);
await emulated.click("#xr");
await inXr(() => graspViewer.renderer.xr.isPresenting && graspViewer.app.answer.current !== undefined);
const held = () => emulated.evaluate(() => graspViewer.app.view.object.group.matrix.elements.slice(12, 15));
const there = await held();
await emulated.evaluate(() => (device.hands.right.position.x += 0.1));
await inXr(`Math.abs(graspViewer.app.view.object.group.matrix.elements[12] - ${there[0]}) > 0.05`);
seen.xr = { there, moved: await held(), status: await emulated.$eval("#outcome", (pill) => pill.textContent) };

seen.problems = problems;
seen.requested = [...requested];
console.log(JSON.stringify(seen));
await browser.close();
