"""The client's calls, both kinds of it."""

import asyncio
import contextlib
import os
import pathlib
import pickle
import socket
import threading
import time

import grpc
import numpy as np
import pytest

import grasp
from gateway import gateway_to
from grasp import v1

ADDRESS = os.environ["GRASP_ADDRESS"]
ROOT = pathlib.Path(__file__).resolve().parents[3]
HELD_UP = grasp.matrix(([0.1, 1.2, 0.4], [0.0, 0.6, 0.0, 0.8]))


class Blocking:
    """An AsyncClient that the same checks can drive: each call runs to its end."""

    def __init__(self, wrapped, loop):
        self.wrapped, self.loop = wrapped, loop

    def __getattr__(self, name):
        found = getattr(self.wrapped, name)
        if not callable(found):
            return Blocking(found, self.loop)

        async def called(*arguments, **options):
            result = found(*arguments, **options)
            return await result if asyncio.iscoroutine(result) else result

        def call(*arguments, **options):
            result = self.loop.run_until_complete(called(*arguments, **options))
            if hasattr(result, "__anext__"):
                return self._iterate(result)
            return Blocking(result, self.loop) if hasattr(result, "close") else result

        return call

    def _iterate(self, messages):
        try:
            while True:
                yield self.loop.run_until_complete(anext(messages))
        except StopAsyncIteration:
            return
        finally:
            self.loop.run_until_complete(messages.aclose())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


@contextlib.contextmanager
def opened(kind, target, **options):
    if kind == "sync":
        with grasp.Client(target, **options) as client:
            yield client
        return
    loop = asyncio.new_event_loop()

    async def connect():
        return grasp.AsyncClient(target, **options)

    with Blocking(loop.run_until_complete(connect()), loop) as client:
        yield client
    loop.close()


@pytest.fixture(params=["sync", "async"])
def kind(request):
    return request.param


@pytest.fixture
def either(kind):
    with opened(kind, ADDRESS) as client:
        yield client


def test_finds_a_grasp_where_the_object_is(either):
    result = either.find("objects/scissors", client_from_object=HELD_UP, receiver="left", seed=1, packed=True)
    hand = result.grasp
    assert (result.outcome, hand.handedness, hand.convention) == ("found", "left", "openxr")
    np.testing.assert_allclose(hand.client_from_wrist, HELD_UP @ hand.object_from_wrist, atol=1e-5)
    assert hand.joints.positions.shape == (26, 3)
    np.testing.assert_allclose(hand.joints.poses[1], hand.client_from_wrist, atol=1e-6)
    assert hand.contact_positions.shape == hand.contact_normals.shape == hand.contact_forces.shape
    # The forces carry 50 g against gravity, in the object's frame.
    weight = HELD_UP[:3, :3] @ hand.contact_forces.sum(0)
    np.testing.assert_allclose(weight, [0, 0.05 * 9.81, 0], atol=0.05)
    assert either.validate("objects/scissors", hand, client_from_object=HELD_UP).valid
    assert grasp.PackedGrasp.decode(hand.packed).type == hand.type
    kept = either.find("objects/scissors", client_from_object=HELD_UP, receiver="left", current=hand)
    assert kept.message.current.status == v1.CURRENT_GRASP_STATUS_KEPT


def test_tracked_hands_are_avoided_in_the_convention_of_their_engine(either):
    giver = either.find("objects/scissors", receiver="right", seed=1, convention="unreal").grasp.joints
    assert giver.convention == "unreal"
    options = {"presenting_hand": giver, "receiver": "left", "convention": "unreal", "budget": 2}
    result = either.find("objects/scissors", **options)
    margins = {margin.check: margin for margin in result.grasp.message.margins}
    assert margins[v1.CHECK_GIVER_CLEARANCE].passed
    assert either.validate("objects/scissors", result.grasp, presenting_hand=giver, convention="unreal").valid
    assert either.evaluate("objects/scissors", **options, other_presenting_hands=[giver]).ratings[1].sides
    with pytest.raises(ValueError, match="unreal.*conventions.joints"):
        either.find("objects/scissors", presenting_hand=giver)
    metric = grasp.conventions.joints(giver, "openxr")
    assert either.find("objects/scissors", presenting_hand=metric, receiver="left", budget=2).grasp


def test_streams_every_better_grasp_then_the_outcome(either):
    *better, last = either.stream("objects/remote", budget=0.2, max_rate_hz=1000)
    scores = [result.grasp.score for result in better]
    assert scores and scores == sorted(scores)
    assert (last.outcome, last.grasp) == ("found", None)
    different = list(either.stream("objects/remote", budget=0.2, alternatives=3, differ_by=["approach", "type"]))
    assert 2 <= len(different) <= 4
    begun = either.stream("objects/remote", budget=9)
    assert next(begun).grasp
    started = time.monotonic()
    begun.close()
    assert time.monotonic() - started < 5


def test_tracks_a_giver_who_moves(either):
    with either.track("objects/remote", receiver="right", convention="unity", budget=2, timeout=9) as track:
        for frame in range(20):
            pose = HELD_UP.copy()
            pose[1, 3] += 0.002 * frame
            answer = track.push(client_from_object=pose)
            assert answer.status == ("replanned" if frame == 0 else "kept")
            np.testing.assert_allclose(answer.grasp.client_from_wrist, pose @ answer.grasp.object_from_wrist, atol=1e-5)
        lost = track.push(client_from_object=([0, np.nan, 0], [0, 0, 0, 1]))
        assert (lost.status, lost.message.current.no_grasp) == ("none", v1.CHECK_FRAME)
        assert "client_from_object" in lost.message.warnings[0]
    with pytest.raises(grasp.NotFound, match="ended"):
        track.push()
    # However the refusal and the frame meet on their way.
    for _ in range(30):
        with either.track("objects/nothing", up=[0, 0, 0]) as track, pytest.raises(grasp.InvalidArgument) as refused:
            track.push()
        assert "track.holdout.up" in {violation.field for violation in refused.value.violations}


def test_the_latest_frame_wins():
    with grasp.Client(ADDRESS) as client, client.track("objects/remote") as track:
        track.push()
        answers = []
        threads = [threading.Thread(target=lambda: answers.append(track.push())) for _ in range(20)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(answers) == 20
        assert max(answer.message.sequence for answer in answers) == 21

    async def together():
        async with grasp.AsyncClient(ADDRESS) as client, client.track("objects/remote") as track:
            return await asyncio.gather(*(track.push() for _ in range(20)))

    answers = asyncio.run(together())
    # Those that did not leave in time are answered by a later one.
    assert all(answer.message.sequence >= place for place, answer in enumerate(answers, 1))
    assert len({answer.message.sequence for answer in answers}) < 20


def test_tracks_without_streams_in_both_directions(kind):
    with gateway_to(ADDRESS) as (gateway, through), opened(kind, through) as client:
        with client.track("objects/remote", receiver="right", budget=2) as track:
            assert [track.push().status for _ in range(3)] == ["replanned", "kept", "kept"]
        assert gateway.methods == ["TrackHoldout", "CreateTrack", *["PushFrame"] * 3, "DeleteTrack"]


def test_unavailable_servers_are_asked_again(kind):
    unavailable, exhausted = grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.RESOURCE_EXHAUSTED
    with gateway_to(ADDRESS) as (gateway, through), opened(kind, through) as client:
        gateway.failures = [(unavailable, 0.3, ()), (unavailable, 0, (("grpc-retry-pushback-ms", "10"),))]
        started = time.monotonic()
        assert client.find("objects/remote").grasp
        assert time.monotonic() - started >= 0.3 and len(gateway.methods) == 3
        for failures, kind_of_error, calls, delay in [
            ([(exhausted, 1.5, ())], grasp.ResourceExhausted, 1, 1.5),
            ([(unavailable, 0, (("grpc-retry-pushback-ms", "-1"),))], grasp.Unavailable, 1, 0),
            ([(unavailable, 0, ())] * 9, grasp.Unavailable, 4, 0),
            ([(unavailable, 9, ())], grasp.Unavailable, 1, 9),
        ]:
            gateway.failures, gateway.methods = failures, []
            with pytest.raises(kind_of_error, match="as told") as failed:
                client.find("objects/remote", timeout=5)
            assert (failed.value.retry_after, failed.value.attempts) == (delay, calls) == (delay, len(gateway.methods))
    with opened(kind, "127.0.0.1:1", retry=grasp.RetryPolicy(max_attempts=1)) as client:
        with pytest.raises(grasp.Unavailable):
            client.find("objects/remote")


def test_errors_have_their_details(either):
    with pytest.raises(grasp.InvalidArgument) as refused:
        either.find("objects/remote", budget=-1, up=[0, 0, 0])
    error = refused.value
    assert {violation.field for violation in error.violations} == {"holdout.up", "search.budget"}
    assert error.reason == "INVALID_REQUEST" and "search.budget" in str(error)
    assert pickle.loads(pickle.dumps(error)).violations == error.violations
    with pytest.raises(grasp.NotFound) as missing:
        either.find("objects/nothing")
    assert missing.value.reason == "OBJECT_NOT_FOUND"
    with pytest.raises(grasp.NotFound):
        list(either.stream("objects/nothing"))
    with pytest.raises(grasp.FailedPrecondition):
        either.objects.delete("objects/remote")
    for wrong in (np.zeros((4, 4)), np.diag([1.0, 1, -1, 1]), np.diag([2.0, 2, 2, 1])):
        with pytest.raises(ValueError, match="matri"):
            either.find("objects/remote", client_from_object=wrong)
    with pytest.raises(ValueError, match="unity_flip_x"):
        either.find("objects/remote", convention="blender")


def test_timeouts_are_deadlines(kind):
    with socket.create_server(("127.0.0.1", 0)) as silent, opened(kind, f"127.0.0.1:{silent.getsockname()[1]}") as client:
        started = time.monotonic()
        with pytest.raises(grasp.DeadlineExceeded):
            client.find("objects/remote", timeout=0.3)
        with client.track("objects/remote", timeout=0.3) as track, pytest.raises(grasp.DeadlineExceeded):
            track.push()
        assert 0.6 <= time.monotonic() - started < 8


def sphere_obj(rows):
    """A closed ball of 4 cm in some 70 bytes for each of 2 rows**2 triangles."""
    around = 2 * np.pi * np.arange(rows) / rows
    heights = np.pi * np.arange(1, rows) / rows
    ring = np.stack([np.cos(around), np.zeros(rows), np.sin(around)], 1)
    points = [[0, 1, 0], *(p for h in heights for p in ring * np.sin(h) + [0, np.cos(h), 0]), [0, -1, 0]]
    lines = [f"v {x * 0.02:.12f} {y * 0.02:.12f} {z * 0.02:.12f}" for x, y, z in points]
    for i in range(rows):
        j = (i + 1) % rows
        lines.append(f"f 1 {2 + j} {2 + i}")
        for row in range(rows - 2):
            a, b = 2 + row * rows, 2 + (row + 1) * rows
            lines += [f"f {a + i} {a + j} {b + i}", f"f {a + j} {b + j} {b + i}"]
        last = 2 + (rows - 2) * rows
        lines.append(f"f {last + i} {last + j} {2 + (rows - 1) * rows}")
    return "\n".join(lines).encode()


def test_objects_are_uploaded_watched_and_deleted(either, kind, tmp_path):
    name = f"objects/ball-{kind}"
    path = tmp_path / "ball.obj"
    path.write_bytes(sphere_obj(100))
    watch = either.objects.watch(f'name = "{name}*"', include_present=True)
    assert list(next(watch).changes) == [v1.OBJECT_CHANGE_PRESENT_END]
    sent = []
    options = {"labels": {"made": "by-python"}, "center_of_mass": [0, 0.001, 0]}
    made = either.objects.create(name, path, mass_kg=0.1, progress=lambda *count: sent.append(count), **options)
    assert made.triangle_count == 2 * 100 * 99
    assert len(sent) > 3 and sent == sorted(sent) and sent[-1] == (path.stat().st_size, path.stat().st_size)
    assert v1.OBJECT_CHANGE_CREATED in next(watch).changes
    watch.close()
    assert either.objects.get(name).center_of_mass.y == pytest.approx(0.001)
    assert [found.name for found in either.objects.list(f'name = "{name}*"')] == [name]
    assert either.objects.mesh(name).startswith(b"glTF")
    with pytest.raises(grasp.AlreadyExists):
        either.objects.create(name, sphere_obj(8), mass_kg=0.1)
    either.objects.delete(name, etag=made.etag)
    with pytest.raises(grasp.NotFound):
        either.objects.get(name)


def test_all_pages_are_listed(either, kind):
    names = [f"objects/page-{kind}-{number:02}" for number in range(60)]
    mesh = sphere_obj(8)
    for name in names:
        either.objects.create(name, mesh, mass_kg=0.1)
    assert [found.name for found in either.objects.list(f'name = "objects/page-{kind}*"')] == names
    for name in names:
        either.objects.delete(name)


def test_rigs_are_created_from_models(either, kind):
    rig = either.rigs.create(f"mine-{kind}", ROOT / "assets/hands/adult_right.glb", handedness="right")
    assert rig.name in {found.name for found in either.rigs.list()}
    assert len(either.rigs.get(rig.name).hands) == 2
    either.rigs.delete(rig.name)
    with pytest.raises(grasp.NotFound):
        either.rigs.get(rig.name)


def test_hands_may_lack_a_finger(either, kind):
    adult = next(hand for hand in either.rigs.get("rigs/adult").hands if hand.handedness == v1.HANDEDNESS_RIGHT)
    joints = grasp.Joints.from_messages(adult.stretched_joints, "right", "openxr")
    joints.positions[21:] = np.nan
    request = v1.CreateRigRequest(rig_id=f"four-{kind}", joints=[joints.message()])
    rig = either.call(grasp.methods.CREATE_RIG, request)
    receiver = v1.Receiver(rig=rig.name, handedness=v1.HANDEDNESS_RIGHT, scale=0.9)
    hand = either.find("objects/remote", receiver=receiver, budget=5, packed=True, convention="unity_flip_x").grasp
    assert np.isnan(hand.joints.positions).all(1).tolist() == [False] * 21 + [True] * 5
    packed = grasp.PackedGrasp.decode(hand.packed)
    assert (packed.rig, packed.scale, packed.convention) == (rig.name, 0.9, "unity_flip_x")
    assert np.isnan(packed.angles).all(1).tolist() == [False] * 4 + [True]
    # The object is at the client's origin.
    np.testing.assert_allclose(packed.joints(rig).positions, hand.joints.positions, rtol=0, atol=5e-4)
    either.rigs.delete(rig.name)
