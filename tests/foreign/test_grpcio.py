"""Calls the service through grpcio, which wraps gRPC's C++ implementation, also with the WebXR input profiles' generic hand as a rig, a
model by others."""

import hashlib
import json
import math
import struct
import subprocess
import time
import uuid

import grpc
import pytest
from google.protobuf.duration_pb2 import Duration
from google.rpc import error_details_pb2
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from grpc_status import rpc_status

from conftest import ROOT, start_server, stop_server

from grasp.v1 import error_reason_pb2, grasp_pb2, grasp_service_pb2, grasp_service_pb2_grpc, hand_rig_service_pb2
from grasp.v1 import hand_rig_service_pb2_grpc, holdout_pb2, object_service_pb2, object_service_pb2_grpc, search_pb2

# A closed box of 2 x 2 x 12 cm, in centimetres; bit k of i gives corner i's coordinate on axis k.
BOX_OBJ = "\n".join(
    [f"v {2 * (i & 1) - 1} {2 * (i >> 1 & 1) - 1} {12 * (i >> 2 & 1) - 6}" for i in range(8)]
    + ["f 1 3 4 2", "f 5 6 8 7", "f 1 2 6 5", "f 3 7 8 4", "f 1 5 7 3", "f 2 4 8 6"]
)


def box(object_id, request_id="", **fields):
    """A request to create the box."""
    return object_service_pb2.CreateObjectRequest(
        object=object_service_pb2.GraspObject(
            name=f"objects/{object_id}", meters_per_unit=0.01, mass_kg=0.1, **fields
        ),
        mesh=BOX_OBJ.encode(),
        request_id=request_id,
    )


def find(name, receiver=None, **search):
    """A request for a grasp."""
    return grasp_service_pb2.FindGraspRequest(
        holdout=holdout_pb2.Holdout(object=name),
        receiver=receiver,
        search=search_pb2.SearchOptions(**search),
    )


def details(error, kind):
    """The error's standard details of the given kind."""
    found = []
    for detail in rpc_status.from_call(error).details:
        message = kind()
        if detail.Unpack(message):
            found.append(message)
    return found


@pytest.fixture(scope="module")
def grasps(channel):
    return grasp_service_pb2_grpc.GraspServiceStub(channel)


@pytest.fixture(scope="module")
def objects(channel):
    return object_service_pb2_grpc.ObjectServiceStub(channel)


def test_health_reports_serving_overall_and_per_service(channel):
    health = health_pb2_grpc.HealthStub(channel)
    for service in ["", "grasp.v1.GraspService", "grasp.v1.ObjectService", "grasp.v1.HandRigService"]:
        answer = health.Check(health_pb2.HealthCheckRequest(service=service))
        assert answer.status == health_pb2.HealthCheckResponse.SERVING
    with pytest.raises(grpc.RpcError) as rejected:
        health.Check(health_pb2.HealthCheckRequest(service="grasp.v1.NoSuchService"))
    assert rejected.value.code() == grpc.StatusCode.NOT_FOUND


def test_reflection_lists_the_services(channel):
    database = ProtoReflectionDescriptorDatabase(channel)
    assert {"grasp.v1.GraspService", "grasp.v1.ObjectService", "grpc.health.v1.Health"} <= set(database.get_services())


def test_built_in_objects_have_the_masses_of_table_5_1(objects):
    masses = {o.name: o.mass_kg for o in objects.ListObjects(object_service_pb2.ListObjectsRequest()).objects}
    for name, mass in {"scissors": 0.050, "scalpel": 0.020, "remote": 0.130}.items():
        assert masses[f"objects/{name}"] == pytest.approx(mass)


def test_pages_list_each_object_once(objects):
    names, token = [], ""
    while True:
        page = objects.ListObjects(object_service_pb2.ListObjectsRequest(page_size=2, page_token=token))
        assert len(page.objects) <= 2
        names += [o.name for o in page.objects]
        token = page.next_page_token
        if not token:
            break
    assert names == sorted(set(names))
    assert len(names) >= 3


def test_created_box_has_its_dimensions_and_can_be_grasped(objects, grasps):
    created = objects.CreateObject(box("box"))
    assert created.triangle_count == 12
    half = created.bounding_box.half_extents
    assert sorted([half.x, half.y, half.z]) == pytest.approx([0.01, 0.01, 0.06], rel=1e-3)
    centre = created.center_of_mass
    assert [centre.x, centre.y, centre.z] == pytest.approx([0, 0, 0], abs=1e-6)

    answer = grasps.FindGrasp(find("objects/box", budget=Duration(seconds=9), seed=1), timeout=20)
    assert answer.outcome == grasp_pb2.OUTCOME_FOUND
    (grasp,) = answer.grasps
    assert len(grasp.hand.joints) == 26
    assert all(grasp.hand.HasField(digit) for digit in ("thumb", "index", "middle", "ring", "little"))
    assert {c.digit for c in grasp.contacts} >= {holdout_pb2.DIGIT_THUMB}
    for contact in grasp.contacts:
        p, n = contact.position, contact.normal
        # On the surface of the box: its closed form is 1.
        assert max(abs(p.x) / 0.01, abs(p.y) / 0.01, abs(p.z) / 0.06) == pytest.approx(1, abs=1e-3)
        assert n.x**2 + n.y**2 + n.z**2 == pytest.approx(1, abs=1e-4)


def test_an_answer_is_the_next_request_s_current_grasp(objects, grasps):
    request = find("objects/remote", budget=Duration(seconds=9), seed=1)
    (grasp,) = grasps.FindGrasp(request, timeout=20).grasps
    request.current.grasp.CopyFrom(grasp.hand)
    answer = grasps.FindGrasp(request, timeout=20)
    assert answer.current.status == grasp_pb2.CURRENT_GRASP_STATUS_KEPT
    assert answer.origin.source == grasp_pb2.GRASP_SOURCE_CURRENT
    assert answer.grasps[0].hand.object_from_wrist == grasp.hand.object_from_wrist


def test_rejects_an_object_name_that_exists(objects):
    request = box("twice")
    objects.CreateObject(request)
    with pytest.raises(grpc.RpcError) as rejected:
        objects.CreateObject(request)
    assert rejected.value.code() == grpc.StatusCode.ALREADY_EXISTS


def test_a_repeated_request_answers_the_object_it_created(objects):
    request = box("repeated", request_id=str(uuid.uuid4()), labels={"level": "kitchen", "fragile": ""})
    first = objects.CreateObject(request)
    assert objects.CreateObject(request).etag == first.etag
    assert dict(first.labels) == {"level": "kitchen", "fragile": ""}
    age = time.time() - first.create_time.ToSeconds()
    assert -1 <= age < 300


def test_updates_masked_fields_and_deletes(objects):
    created = objects.CreateObject(box("changing", friction=0.9))
    change = object_service_pb2.GraspObject(
        name=created.name, mass_kg=0.2, labels={"level": "cellar"}, etag=created.etag
    )
    request = object_service_pb2.UpdateObjectRequest(object=change)
    request.update_mask.paths.extend(["mass_kg", "labels", "friction"])
    changed = objects.UpdateObject(request)
    assert changed.mass_kg == pytest.approx(0.2)
    assert not changed.HasField("friction")
    with pytest.raises(grpc.RpcError) as rejected:
        objects.UpdateObject(request)
    assert rejected.value.code() == grpc.StatusCode.ABORTED
    listed = objects.ListObjects(object_service_pb2.ListObjectsRequest(filter='labels.level = "cellar"')).objects
    assert [o.name for o in listed] == [created.name]
    objects.DeleteObject(object_service_pb2.DeleteObjectRequest(name=created.name, etag=changed.etag))
    with pytest.raises(grpc.RpcError) as rejected:
        objects.GetObject(object_service_pb2.GetObjectRequest(name=created.name))
    assert rejected.value.code() == grpc.StatusCode.NOT_FOUND


def upload_parts(object_id, mesh, sha256):
    create = box(object_id)
    create.ClearField("mesh")
    yield object_service_pb2.UploadObjectRequest(create=create, total_bytes=len(mesh))
    for start in range(0, len(mesh), 100):
        yield object_service_pb2.UploadObjectRequest(piece=mesh[start : start + 100])
    yield object_service_pb2.UploadObjectRequest(sha256=sha256)


def test_uploads_in_pieces_and_returns_the_mesh(objects):
    mesh = BOX_OBJ.encode()
    with pytest.raises(grpc.RpcError) as rejected:
        objects.UploadObject(upload_parts("uploaded", mesh, hashlib.sha256(b"other").hexdigest()))
    assert rejected.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    uploaded = objects.UploadObject(upload_parts("uploaded", mesh, hashlib.sha256(mesh).hexdigest()))
    assert uploaded.triangle_count == 12
    parts = list(objects.GetMesh(object_service_pb2.GetMeshRequest(name=uploaded.name)))
    assert parts[0].etag == uploaded.etag
    glb = b"".join(part.piece for part in parts)
    assert struct.unpack("<4sII", glb[:12]) == (b"glTF", 2, len(glb))


def test_watches_objects(objects):
    watch = objects.WatchObjects(object_service_pb2.WatchObjectsRequest(filter='name = "objects/watched*"', include_present=True))
    end = next(watch)
    assert list(end.changes) == [object_service_pb2.OBJECT_CHANGE_PRESENT_END]
    objects.CreateObject(box("watched", labels={"watched": ""}))
    news = next(watch)
    assert news.object.name == "objects/watched"
    assert object_service_pb2.OBJECT_CHANGE_CREATED in news.changes
    watch.cancel()


def test_reports_all_violations_at_once(grasps):
    request = find("objects/remote", budget=Duration(seconds=-1))
    request.holdout.client_from_object.position.x = float("nan")
    request.holdout.client_from_object.orientation.SetInParent()
    request.holdout.up.SetInParent()
    with pytest.raises(grpc.RpcError) as rejected:
        grasps.FindGrasp(request)
    assert rejected.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    (bad_request,) = details(rejected.value, error_details_pb2.BadRequest)
    fields = {violation.field for violation in bad_request.field_violations}
    assert {
        "holdout.client_from_object.position",
        "holdout.client_from_object.orientation",
        "holdout.up",
        "search.budget",
    } <= fields
    (info,) = details(rejected.value, error_details_pb2.ErrorInfo)
    assert f"ERROR_REASON_{info.reason}" in error_reason_pb2.ErrorReason.keys()


def test_unknown_object_is_not_found(grasps):
    with pytest.raises(grpc.RpcError) as rejected:
        grasps.FindGrasp(find("objects/teapot"))
    assert rejected.value.code() == grpc.StatusCode.NOT_FOUND
    (resource,) = details(rejected.value, error_details_pb2.ResourceInfo)
    assert resource.resource_name == "objects/teapot"


def unanswerable(**settings):
    """A request that no attempt can satisfy."""
    return find("objects/slippery", seed=7, **settings)


@pytest.fixture(scope="module")
def slippery(objects):
    # All twelve triangles are forbidden, so nothing can be touched.
    forbidden = object_service_pb2.Region(
        name="all", preference=object_service_pb2.PREFERENCE_FORBIDDEN, triangles=range(12)
    )
    objects.CreateObject(box("slippery", regions=[forbidden]))


def test_exhausted_budget_returns_a_report(grasps, slippery):
    answer = grasps.FindGrasp(unanswerable(budget=Duration(nanos=50_000_000)), timeout=5)
    assert answer.outcome == grasp_pb2.OUTCOME_BUDGET_EXHAUSTED
    assert not answer.grasps
    assert answer.report.attempts == sum(r.count for r in answer.report.rejections) > 0
    assert answer.report.HasField("nearest_miss")


def test_deadline_bounds_the_search(grasps, slippery):
    answer = grasps.FindGrasp(unanswerable(budget=Duration(seconds=9)), timeout=1)
    assert answer.outcome == grasp_pb2.OUTCOME_BUDGET_EXHAUSTED
    assert 0 < answer.report.search_time.ToMilliseconds() < 1000


def test_cancelled_call_frees_the_server(grasps, slippery):
    call = grasps.FindGrasp.future(unanswerable(budget=Duration(seconds=9)))
    time.sleep(0.2)
    call.cancel()
    answer = grasps.FindGrasp(unanswerable(budget=Duration(nanos=50_000_000)), timeout=5)
    assert answer.outcome == grasp_pb2.OUTCOME_BUDGET_EXHAUSTED


def wait_for_complete_atlas(objects, name):
    """Answers are reproducible from then on. Unless target/atlases has the atlas, it has to grow first."""
    deadline = time.monotonic() + 300
    request = object_service_pb2.GetAtlasRequest(name=f"{name}/atlases/right")
    while objects.GetAtlas(request).growth != grasp_pb2.ATLAS_GROWTH_COMPLETE:
        assert time.monotonic() < deadline, f"the atlas of {name} is not complete"
        time.sleep(0.05)


def test_reproducible_answer_repeats(objects, grasps):
    wait_for_complete_atlas(objects, "objects/scissors")
    request = find(
        "objects/scissors", budget=Duration(seconds=9), seed=3, choice=search_pb2.GRASP_CHOICE_REPRODUCIBLE
    )
    first, second = (grasps.FindGrasp(request, timeout=20) for _ in range(2))
    assert first.outcome == grasp_pb2.OUTCOME_FOUND
    assert first.grasps == second.grasps
    assert first.origin == second.origin


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


@pytest.fixture
def secrets(tmp_path):
    """A certificate of this machine with its key, and a token with its file."""
    pair = ["-keyout", tmp_path / "server.key", "-out", tmp_path / "server.pem"]
    names = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
    new = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "90"]
    try:
        subprocess.run([*new, *pair, *names], check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("there is no openssl to make a certificate")
    server = ROOT / "target/release/grasp-server"
    made = subprocess.run([server, "--new-token", "foreign"], check=True, capture_output=True, text=True)
    (tmp_path / "tokens.toml").write_text(made.stdout)
    return tmp_path, made.stderr.strip()


def test_a_token_over_tls(secrets):
    folder, token = secrets
    files = {"certificate": "server.pem", "key": "server.key"}
    flags = [flag for key, name in files.items() for flag in (f"--tls-{key}", str(folder / name))]
    process, address = start_server("--listen", "127.0.0.1:0", *flags, "--tokens-file", str(folder / "tokens.toml"))
    encrypted = grpc.ssl_channel_credentials((folder / "server.pem").read_bytes())
    request = object_service_pb2.GetObjectRequest(name="objects/remote")
    with grpc.secure_channel(address, encrypted) as channel:
        health = health_pb2_grpc.HealthStub(channel).Check(health_pb2.HealthCheckRequest())
        assert health.status == health_pb2.HealthCheckResponse.SERVING
        with pytest.raises(grpc.RpcError) as caught:
            object_service_pb2_grpc.ObjectServiceStub(channel).GetObject(request)
        assert caught.value.code() == grpc.StatusCode.UNAUTHENTICATED
        assert details(caught.value, error_details_pb2.ErrorInfo)[0].reason == "TOKEN_MISSING"
    known = grpc.composite_channel_credentials(encrypted, grpc.access_token_call_credentials(token))
    with grpc.secure_channel(address, known) as channel:
        objects = object_service_pb2_grpc.ObjectServiceStub(channel)
        assert objects.GetObject(request).owner == ""
        assert objects.CreateObject(box("owned")).owner == "foreign"
    stop_server(process)
