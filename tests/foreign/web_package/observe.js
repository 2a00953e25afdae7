// Watches a sample page from the outside: tells the page's server where the bones of the visible hands are once they rest, with the last
// grasp that was answered, and a picture.

const shown = { scenes: [], answer: null, awaited: 1, before: "", resting: 0, picture: null, bones: null };
// Pictures in a row without a change.
const RESTING = 3;

// three announces scenes and renderers to its developer tools.
globalThis.__THREE_DEVTOOLS__ = new EventTarget();
__THREE_DEVTOOLS__.addEventListener("observe", ({ detail }) => {
  if (detail.isScene) {
    shown.scenes.push(detail);
  } else if (detail.domElement) {
    const render = detail.render.bind(detail);
    detail.render = (...all) => {
      render(...all);
      drawn(detail.domElement);
    };
  }
});

function drawn(canvas) {
  const places = bones();
  const now = JSON.stringify(places);
  shown.resting = shown.awaited <= 0 && now !== "{}" && now === shown.before ? shown.resting + 1 : 0;
  shown.before = now;
  if (shown.resting === RESTING) {
    shown.picture ??= canvas.toDataURL("image/png");
    shown.bones ??= places;
  }
}

const fetchAll = globalThis.fetch;
globalThis.fetch = async (input, init) => {
  const response = await fetchAll(input, init);
  if (/FindGrasp|PushFrame/.test(input.url ?? input)) {
    const answer = await response.clone().json();
    if (answer.grasp || answer.grasps) {
      shown.answer = answer;
      shown.awaited -= 1;
    }
  }
  return response;
};

const LONGEST = 60_000;

function pause(milliseconds) {
  if (performance.now() > LONGEST) {
    throw new Error(`the page took too long: ${JSON.stringify({ ...shown, scenes: shown.scenes.length })}`);
  }
  return new Promise((done) => setTimeout(done, milliseconds));
}

function bones() {
  const places = {};
  for (const scene of shown.scenes) {
    scene.traverseVisible((object) => {
      if (object.isBone) {
        places[object.name] = object.matrixWorld.elements.slice(12, 15);
      }
    });
  }
  return places;
}

const failures = [];
addEventListener("error", ({ message }) => failures.push(message));
addEventListener("unhandledrejection", ({ reason }) => failures.push(String(reason)));

// With emulated hands, enters VR as soon as the page offers it, and moves the giver's hand.
async function giveByHand() {
  shown.awaited = Infinity;
  const device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: false });
  device.installRuntime({ forceInstall: true });
  device.primaryInputMode = "hand";
  device.hands.left.connected = false;
  device.hands.right.poseId = "pinch";
  device.hands.right.updateHandPose?.(1);
  device.fovy = 0.5;
  device.position.set(0.25, 1.45, 0.05);
  device.quaternion.set(-0.17, 0.2, 0.03, 0.965);
  device.hands.right.position.set(0.05, 1.25, -0.4);
  while (!document.querySelector("#VRButton")?.onclick && failures.length === 0) {
    await pause(50);
  }
  document.querySelector("#VRButton").click();
  for (let step = 0; step < 20; step++) {
    await pause(50);
    device.hands.right.position.x -= 0.004;
  }
  // The next answer may be to a frame of before, the one after it is not.
  shown.awaited = 2;
}

async function watch() {
  if (globalThis.IWER) {
    await giveByHand();
  }
  while (!shown.picture && failures.length === 0) {
    await pause(50);
  }
  return { answer: shown.answer, bones: shown.bones, picture: shown.picture, failures };
}

const report = (result) => fetchAll("/result", { method: "POST", body: JSON.stringify(result) });
watch().then(report, (error) => report({ failures: [...failures, String(error)] }));
