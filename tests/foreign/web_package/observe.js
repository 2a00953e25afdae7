// Watches a sample page from the outside: tells the page's server where the bones of the visible hands are once they rest, with the last
// grasp that was answered, and a picture.

const shown = { scenes: [], renderer: null, answer: null, picture: null };

// three announces scenes and renderers to its developer tools.
globalThis.__THREE_DEVTOOLS__ = new EventTarget();
__THREE_DEVTOOLS__.addEventListener("observe", ({ detail }) => {
  if (detail.isScene) {
    shown.scenes.push(detail);
  } else if (detail.domElement) {
    shown.renderer = detail;
    const render = detail.render.bind(detail);
    detail.render = (...all) => {
      render(...all);
      if (shown.picture === "wanted") {
        shown.picture = detail.domElement.toDataURL("image/png");
      }
    };
  }
});

const fetchAll = globalThis.fetch;
globalThis.fetch = async (input, init) => {
  const response = await fetchAll(input, init);
  if (/FindGrasp|PushFrame/.test(input.url ?? input)) {
    const answer = await response.clone().json();
    if (answer.grasp || answer.grasps) {
      shown.answer = answer;
    }
  }
  return response;
};

const LONGEST = 60_000;

function pause(milliseconds) {
  if (performance.now() > LONGEST) {
    throw new Error(
      `the page took too long: ${JSON.stringify({ ...shown, scenes: shown.scenes.length, renderer: !!shown.renderer, bones: bones() })}`,
    );
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
}

async function watch() {
  if (globalThis.IWER) {
    await giveByHand();
  }
  let [before, resting] = ["", 0];
  while (resting < 4 && failures.length === 0) {
    await pause(100);
    const now = JSON.stringify(bones());
    resting = shown.answer && now !== "{}" && now === before ? resting + 1 : 0;
    before = now;
  }
  shown.picture = "wanted";
  while (shown.picture === "wanted" && failures.length === 0) {
    await pause(20);
  }
  return { answer: shown.answer, bones: bones(), picture: shown.picture, failures };
}

const report = (result) => fetchAll("/result", { method: "POST", body: JSON.stringify(result) });
watch().then(report, (error) => report({ failures: [...failures, String(error)] }));
