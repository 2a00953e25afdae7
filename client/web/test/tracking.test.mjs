import assert from "node:assert/strict";
import { test } from "node:test";
import { Code, ConnectError } from "@connectrpc/connect";
import { CurrentGraspStatus, GraspTracker, handAt } from "@grasp/client";
import { assertSamePose, vectors } from "./golden.mjs";

const { KEPT, NONE, REPLANNED } = CurrentGraspStatus;
const [first, second] = vectors.map(({ conventions }) => conventions[0].grasp).filter(({ hand }) => hand.handedness === 2);
const at = (x) => ({ position: { x, y: 0, z: 0 }, orientation: { x: 0, y: 0, z: 0, w: 1 } });
const settle = (milliseconds = 0) => new Promise((done) => setTimeout(done, milliseconds));

// A tracker whose calls wait for the test's answers.
function tracker() {
  const calls = [];
  const created = [];
  const deleted = [];
  const events = { statuses: [], errors: [], answers: [] };
  const grasps = {
    createTrack: async (track) => ({ name: `tracks/${created.push(track)}` }),
    pushFrame: (frame) => new Promise((answer, reject) => calls.push({ frame, answer, reject })),
    deleteTrack: async ({ name }) => deleted.push(name),
  };
  const tracked = new GraspTracker(
    { grasps },
    { holdout: { object: "objects/remote" } },
    {
      onStatus: (status) => events.statuses.push(status),
      onError: (error) => events.errors.push(error.code),
      onAnswer: (answer) => events.answers.push(answer),
    },
  );
  const push = async (x) => {
    tracked.push({ holdout: { clientFromObject: at(x) } });
    await settle();
  };
  const answer = async (status, grasp) => {
    calls.at(-1).answer({ current: { status }, grasp });
    await settle();
  };
  return { tracked, calls, created, deleted, events, push, answer };
}

const placeOf = ({ frame }) => frame.holdout.clientFromObject.position.x;

test("one frame is on its way, and the newest follows", async () => {
  const { calls, push, answer, created } = tracker();
  for (const x of [1, 2, 3]) {
    await push(x);
  }
  assert.deepEqual(calls.map(placeOf), [1]);
  await answer(REPLANNED, first);
  assert.deepEqual(calls.map(placeOf), [1, 3]);
  assert.deepEqual(
    calls.map(({ frame }) => [frame.track, frame.sequence]),
    [
      ["tracks/1", 1n],
      ["tracks/1", 2n],
    ],
  );
  assert.ok(calls.every(({ frame }) => frame.captureTime.nanos >= 0));
  assert.equal(created.length, 1);
});

test("statuses are reported when they change, and at every new grasp", async () => {
  const { tracked, push, answer, events } = tracker();
  for (const [status, grasp] of [[NONE], [NONE], [REPLANNED, first], [REPLANNED, second], [KEPT, second], [KEPT, second], [NONE]]) {
    await push(0);
    await answer(status, grasp);
    assert.equal(tracked.grasp?.hand, grasp?.hand);
  }
  assert.deepEqual(events.statuses, [NONE, REPLANNED, REPLANNED, KEPT, NONE]);
  assert.equal(events.answers.length, 7);
  assert.equal(tracked.handAt(at(0)), undefined);
});

test("an overtaken frame changes nothing", async () => {
  const { tracked, push, answer, calls } = tracker();
  await push(0);
  await answer(REPLANNED, first);
  await push(1);
  calls.at(-1).answer({ sequence: 2n });
  await settle();
  assert.equal(tracked.grasp.hand, first.hand);
});

test("a kept grasp is completed from the one before", async () => {
  const { tracked, push, answer } = tracker();
  await push(0);
  await answer(REPLANNED, first);
  await push(1);
  const { clientFromWrist, objectFromWrist } = handAt(first.hand, at(5));
  await answer(KEPT, { hand: { ...first.hand, clientFromWrist, objectFromWrist, joints: [] }, contacts: [], score: 0.5 });
  assert.deepEqual([tracked.grasp.contacts.length, tracked.grasp.score], [first.contacts.length, 0.5]);
  assertSamePose(tracked.grasp.hand.joints[9].pose, handAt(first.hand, at(5)).joints[9].pose, 1e-5, 1e-4, "a joint");
});

test("the hand goes to a new grasp without a jump, and is at the object", async () => {
  const { tracked, push, answer } = tracker();
  for (const grasp of [first, second]) {
    await push(0);
    await answer(REPLANNED, grasp);
  }
  const [before, after] = [handAt(first.hand, at(2)), handAt(second.hand, at(2))];
  const travelled = () => {
    const [a, b, hand] = [before, after, tracked.handAt(at(2))].map(({ clientFromWrist }) => clientFromWrist.position);
    return (hand.x - a.x) / (b.x - a.x);
  };
  assert.ok(travelled() < 0.9);
  await settle(160);
  assert.ok(Math.abs(travelled() - 1) < 1e-6);
});

test("after an error frames go on, after a while", async () => {
  const { calls, push, events } = tracker();
  await push(0);
  calls[0].reject(new ConnectError("away", Code.Unavailable));
  await settle();
  await push(1);
  assert.equal(calls.length, 1);
  await settle(300);
  assert.deepEqual(calls.map(placeOf), [0, 1]);
  assert.deepEqual(events.errors, [Code.Unavailable]);
});

test("a track that the server ended begins again, but not for ever", async () => {
  const { calls, push, answer, created, events } = tracker();
  await push(0);
  await answer(REPLANNED, first);
  await push(1);
  calls.at(-1).reject(new ConnectError("ended", Code.NotFound));
  await settle();
  assert.deepEqual([calls.map(placeOf), created.length], [[0, 1, 1], 2]);
  assert.equal(created[1].current, first.hand);
  calls.at(-1).reject(new ConnectError("ended", Code.NotFound));
  await settle();
  assert.deepEqual([calls.length, events.errors], [3, [Code.NotFound]]);
});

test("closing ends the track once the frame is answered", async () => {
  const { tracked, push, answer, deleted } = tracker();
  await push(0);
  const closed = tracked.close();
  await answer(REPLANNED, first);
  await closed;
  assert.deepEqual(deleted, ["tracks/1"]);
});
