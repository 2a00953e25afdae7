"""The WebXR input profiles' generic hand as a rig: a model that nobody here made."""

import json
import math
import struct

import grpc
import pytest
from conftest import ROOT
from google.protobuf.duration_pb2 import Duration

from grasp.v1 import grasp_pb2, grasp_service_pb2, grasp_service_pb2_grpc, holdout_pb2, search_pb2
from grasp.v1 import hand_rig_service_pb2, hand_rig_service_pb2_grpc

PROFILES = ROOT / "target/foreign/node_modules/@webxr-input-profiles/assets/dist/profiles"
SIDES = {"left": holdout_pb2.HANDEDNESS_LEFT, "right": holdout_pb2.HANDEDNESS_RIGHT}
# The OpenXR order of the joints.
FINGERS = [
    f"{finger}-finger-{part}"
    for finger in ("index", "middle", "ring", "pinky")
    for part in ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
]
THUMB = ["thumb-metacarpal", "thumb-phalanx-proximal", "thumb-phalanx-distal", "thumb-tip"]
JOINTS = ["palm", "wrist", *THUMB, *FINGERS]


def nodes_of(glb):
    """The nodes of a GLB file by name."""
    (length,) = struct.unpack("<I", glb[12:16])
    return {node["name"]: node for node in json.loads(glb[20 : 20 + length])["nodes"]}


def rotated(q, v):
    """A vector turned by a quaternion."""
    cross = lambda a, b: [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    axis = [q.x, q.y, q.z]
    once = [2 * c for c in cross(axis, v)]
    return [v[i] + q.w * once[i] + cross(axis, once)[i] for i in range(3)]


def position(message):
    return [message.x, message.y, message.z]


@pytest.fixture(scope="module", params=SIDES)
def created(request, channel):
    side = request.param
    glb = (PROFILES / "generic-hand" / f"{side}.glb").read_bytes()
    rigs = hand_rig_service_pb2_grpc.HandRigServiceStub(channel)
    rig = rigs.CreateRig(
        hand_rig_service_pb2.CreateRigRequest(rig_id=f"webxr-{side}", models=[glb], handedness=SIDES[side])
    )
    yield side, nodes_of(glb), rig
    rigs.DeleteRig(hand_rig_service_pb2.DeleteRigRequest(name=rig.name))
    with pytest.raises(grpc.RpcError) as gone:
        rigs.GetRig(hand_rig_service_pb2.GetRigRequest(name=rig.name))
    assert gone.value.code() == grpc.StatusCode.NOT_FOUND


def test_bones_are_those_of_the_model(created):
    side, nodes, rig = created
    [hand] = [hand for hand in rig.hands if hand.handedness == SIDES[side]]
    [other] = [hand for hand in rig.hands if hand.handedness != SIDES[side]]
    assert other.mirrored and not hand.mirrored
    at = {name: position(joint.pose.position) for name, joint in zip(JOINTS, hand.stretched_joints)}
    for start, end in zip(JOINTS, JOINTS[1:]):
        # The palm is no node; tips are where the skin ends; only bones below the same knuckle keep their length.
        if start in ("palm", "wrist") or end.endswith("tip") or start.endswith("tip") or start.endswith("metacarpal"):
            continue
        expected = math.dist(nodes[start]["translation"], nodes[end]["translation"])
        assert abs(math.dist(at[start], at[end]) - expected) < 1e-4, (start, end)
    assert all(0.003 < joint.radius < 0.03 for joint in hand.stretched_joints)


def test_posed_nodes_are_where_the_answered_joints_are(created, channel):
    side, nodes, rig = created
    grasps = grasp_service_pb2_grpc.GraspServiceStub(channel)
    request = grasp_service_pb2.FindGraspRequest(
        holdout=holdout_pb2.Holdout(object="objects/remote"),
        receiver=search_pb2.Receiver(rig=rig.name, handedness=SIDES[side]),
        search=search_pb2.SearchOptions(budget=Duration(seconds=5)),
    )
    answer = grasps.FindGrasp(request)
    assert answer.outcome == grasp_pb2.OUTCOME_FOUND
    answered = answer.grasps[0].hand
    # This model's joints are all next to one another below its armature.
    assert answered.model[0].node == "Armature" and not answered.HasField("scale")
    root = answered.model[0].pose
    posed = {node.node: node.pose for node in answered.model}
    for name, joint in zip(JOINTS, answered.joints):
        if name == "palm" or name.endswith("tip"):
            continue
        pose = posed[name]
        local = position(pose.position) if pose.HasField("position") else nodes[name]["translation"]
        placed = [a + b for a, b in zip(position(root.position), rotated(root.orientation, local))]
        assert math.dist(placed, position(joint.pose.position)) < 5e-4, name
