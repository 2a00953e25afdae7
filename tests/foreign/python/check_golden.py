"""The golden grasps of the contract: conventions, packed grasps and forward kinematics, and one of them live."""

import base64
import json
import os
import pathlib

import numpy as np
import pytest
from google.protobuf import json_format

import grasp
from grasp import conventions, v1

ROOT = pathlib.Path(__file__).resolve().parents[3]
GOLDEN = json.loads((ROOT / "proto/golden/grasps.json").read_text())
RIGS = {name: json_format.ParseDict(rig, v1.HandRig()) for name, rig in GOLDEN["rigs"].items()}


def answers(vector):
    """The vector's grasp in each convention, by its name."""
    for one in vector["conventions"]:
        answer = grasp.FindResult(json_format.ParseDict(one["answer"], v1.FindGraspResponse()))
        name = one["convention"].removeprefix("CONVENTION_").lower()
        assert answer.grasp and answer.grasp.convention == name
        yield name, answer.grasp


def angle(a, b):
    """The angles between rotations (..., 3, 3), in radians."""
    relative = grasp.quaternion_from_matrix(np.swapaxes(a, -1, -2) @ b)
    return 2 * np.arctan2(np.linalg.norm(relative[..., :3], axis=-1), relative[..., 3])


def assert_same_quaternions(a, b):
    # Compared as single precision has them, up to the sign.
    sign = np.sign((a * b).sum(-1, keepdims=True))
    np.testing.assert_allclose(a, sign * b, rtol=0, atol=1e-5)


def assert_same_poses(a, b):
    np.testing.assert_allclose(a[..., :3, 3], b[..., :3, 3], rtol=0, atol=1e-5)
    assert_same_quaternions(grasp.quaternion_from_matrix(a[..., :3, :3]), grasp.quaternion_from_matrix(b[..., :3, :3]))


@pytest.mark.parametrize("vector", GOLDEN["vectors"], ids=lambda vector: vector["name"])
def test_golden_answers_are_the_same_in_openxr(vector):
    by_convention = dict(answers(vector))
    assert set(by_convention) == {"openxr", "unity", "unreal", "godot"}
    expected = by_convention["openxr"]
    for name, given in by_convention.items():
        wrist = conventions.joint_poses(given.client_from_wrist, name, "openxr")
        assert_same_poses(wrist, expected.client_from_wrist)
        wrist = conventions.joint_poses(given.object_from_wrist, name, "openxr", at_object=True)
        assert_same_poses(wrist, expected.object_from_wrist)
        joints = conventions.joints(given.joints, "openxr")
        np.testing.assert_allclose(joints.positions, expected.joints.positions, rtol=0, atol=1e-5)
        assert_same_quaternions(joints.orientations, expected.joints.orientations)
        np.testing.assert_allclose(joints.radii, expected.joints.radii, rtol=0, atol=1e-5)
        back = conventions.joints(joints, name)
        np.testing.assert_allclose(back.positions, given.joints.positions, rtol=0, atol=1e-9 * (100 if name == "unreal" else 1))

        positions = conventions.points(given.contact_positions, name, "openxr", at_object=True)
        np.testing.assert_allclose(positions, expected.contact_positions, rtol=0, atol=1e-5)
        for vectors in ("contact_normals", "contact_forces"):
            converted = conventions.directions(getattr(given, vectors), name, "openxr", at_object=True)
            np.testing.assert_allclose(converted, getattr(expected, vectors), rtol=0, atol=1e-5)


@pytest.mark.parametrize("vector", GOLDEN["vectors"], ids=lambda vector: vector["name"])
def test_golden_packed_grasps_are_the_whole_ones(vector):
    for name, given in answers(vector):
        packed = grasp.PackedGrasp.decode(given.packed)
        hand = given.message.hand
        rig = RIGS[packed.rig]
        unit = 100 if name == "unreal" else 1
        assert (packed.rig, packed.handedness, packed.convention) == (hand.rig, given.handedness, name)
        assert packed.type == given.type
        assert packed.scale == pytest.approx(hand.scale if hand.HasField("scale") else 1)
        touching = {contact.digit for contact in given.message.contacts}
        assert [v1.Digit.Value(f"DIGIT_{digit.upper()}") for digit in packed.contact_digits] == sorted(touching - {0})
        assert packed.palm_contact == (v1.DIGIT_UNSPECIFIED in touching)

        assert np.linalg.norm(packed.object_from_wrist[:3, 3] - given.object_from_wrist[:3, 3]) < 5e-4 * unit
        assert angle(packed.object_from_wrist[:3, :3], given.object_from_wrist[:3, :3]) < np.radians(0.5)
        np.testing.assert_allclose(packed.angles, grasp.digit_angles(hand), rtol=0, atol=np.radians(0.5))
        sent_back = packed.hand_pose()
        np.testing.assert_allclose(grasp.digit_angles(sent_back), packed.angles, rtol=0, atol=1e-6)

        # From the object's frame, which an importer may have turned, to the client's.
        at_client = given.client_from_wrist @ np.linalg.inv(given.object_from_wrist)
        joints = packed.joints(rig)
        positions = joints.positions @ at_client[:3, :3].T + at_client[:3, 3]
        assert np.linalg.norm(positions - given.joints.positions, axis=1).max() < 5e-4 * unit
        assert angle(at_client[:3, :3] @ joints.poses[:, :3, :3], given.joints.poses[:, :3, :3]).max() < np.radians(0.5)
        np.testing.assert_allclose(joints.radii, given.joints.radii, rtol=0, atol=1e-5 * unit)

        exact = grasp.hand_joints(rig, hand)
        assert np.linalg.norm(exact.positions - given.joints.positions, axis=1).max() < 1e-5 * unit


def test_damaged_packed_grasps_are_refused():
    packed = base64.b64decode(GOLDEN["vectors"][0]["conventions"][0]["answer"]["grasps"][0]["packed"])
    for damaged in (b"", packed[:10], packed[:-1], packed + b"\0", b"\2" + packed[1:]):
        with pytest.raises(ValueError, match="packed grasp"):
            grasp.PackedGrasp.decode(damaged)


@pytest.mark.parametrize("place", range(4))
def test_a_golden_request_is_answered_live_as_in_the_file(place):
    one = GOLDEN["vectors"][place]["conventions"][place]
    request = json_format.ParseDict(one["request"], v1.FindGraspRequest())
    expected = json_format.ParseDict(one["answer"], v1.FindGraspResponse())
    with grasp.Client(os.environ["GRASP_ADDRESS"]) as client:
        answer = client.call(grasp.methods.FIND_GRASP, request)
    assert answer.outcome == expected.outcome
    for given, wanted in zip(map(grasp.Grasp, answer.grasps), map(grasp.Grasp, expected.grasps), strict=True):
        tolerance = 1e-3 if given.convention == "unreal" else 1e-5
        np.testing.assert_allclose(given.joints.positions, wanted.joints.positions, rtol=0, atol=tolerance)
        assert_same_poses(given.object_from_wrist, wanted.object_from_wrist)
        assert grasp.PackedGrasp.decode(given.packed).contact_digits == grasp.PackedGrasp.decode(wanted.packed).contact_digits


def test_importers_turn_frames_of_objects():
    """The places where the contract says that importers put (x, y, z) of a file."""
    point = [1.0, 2.0, 3.0]
    for name, expected in {
        "openxr": [1, 2, 3],
        "godot": [1, 2, 3],
        "unity": [1, 2, -3],
        "unity_flip_x": [-1, 2, 3],
        "unreal": [-300, 100, 200],
        "unreal_xzy": [100, 300, 200],
    }.items():
        converted = conventions.points(point, "openxr", name, at_object=True)
        np.testing.assert_allclose(converted, expected, atol=1e-9)
        # A hand at the object keeps its place at it.
        pose = grasp.matrix(([0.3, -0.2, 0.5], [0.1, 0.7, -0.2, 0.6]))
        joint = grasp.matrix(([0.01, 0.02, 0.03], [0.5, -0.1, 0.3, 0.8]))
        in_client = conventions.joint_poses(pose @ joint, "openxr", name)
        at_object = conventions.joint_poses(joint, "openxr", name, at_object=True)
        np.testing.assert_allclose(conventions.object_poses(pose, "openxr", name) @ at_object, in_client, atol=1e-9)
        back = conventions.object_poses(conventions.object_poses(pose, "openxr", name), name, "openxr")
        np.testing.assert_allclose(back, pose, atol=1e-9)
        head = conventions.poses(pose, "openxr", name) @ np.append(conventions.points([1, 2, 3], "openxr", name), 1)
        np.testing.assert_allclose(head[:3], conventions.points((pose @ [1, 2, 3, 1])[:3], "openxr", name), atol=1e-9)
