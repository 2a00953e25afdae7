"""Calls the service through grpcio, which wraps gRPC's C++ implementation."""

import hashlib
import time
import uuid

import grpc
import pytest
from google.protobuf.duration_pb2 import Duration
from google.rpc import error_details_pb2
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from grpc_status import rpc_status

from grasp.v1 import find_grasp_pb2, geometry_pb2, grasp_service_pb2_grpc, hand_pb2
from grasp.v1 import object_service_pb2, object_service_pb2_grpc

# A closed box of 2 x 2 x 12 cm, in centimetres; bit k of i gives corner i's coordinate on axis k.
BOX_OBJ = "\n".join(
    [f"v {2 * (i & 1) - 1} {2 * (i >> 1 & 1) - 1} {12 * (i >> 2 & 1) - 6}" for i in range(8)]
    + ["f 1 3 4 2", "f 5 6 8 7", "f 1 2 6 5", "f 3 7 8 4", "f 1 5 7 3", "f 2 4 8 6"]
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
    created = objects.CreateObject(
        object_service_pb2.CreateObjectRequest(object_id="box", mesh=BOX_OBJ.encode(), unit_metres=0.01, mass_kg=0.1)
    ).object
    assert created.triangle_count == 12
    half = created.box_half_extents
    assert sorted([half.x, half.y, half.z]) == pytest.approx([0.01, 0.01, 0.06], rel=1e-3)
    centre = created.centre_of_mass
    assert [centre.x, centre.y, centre.z] == pytest.approx([0, 0, 0], abs=1e-6)

    answer = grasps.FindGrasp(
        find_grasp_pb2.FindGraspRequest(object="objects/box", budget=Duration(seconds=9), seed=1), timeout=20
    )
    assert answer.outcome == find_grasp_pb2.OUTCOME_FOUND
    grasp = answer.grasp
    assert len(grasp.joints) == 26
    assert len(grasp.digits) == 5
    assert {c.digit for c in grasp.contacts} >= {hand_pb2.DIGIT_THUMB}
    for contact in grasp.contacts:
        p, n = contact.object_position, contact.object_normal
        # On the surface of the box: its closed form is 1.
        assert max(abs(p.x) / 0.01, abs(p.y) / 0.01, abs(p.z) / 0.06) == pytest.approx(1, abs=1e-3)
        assert n.x**2 + n.y**2 + n.z**2 == pytest.approx(1, abs=1e-4)


def test_rejects_an_object_id_that_exists(objects):
    request = object_service_pb2.CreateObjectRequest(
        object_id="twice", mesh=BOX_OBJ.encode(), unit_metres=0.01, mass_kg=0.1
    )
    objects.CreateObject(request)
    with pytest.raises(grpc.RpcError) as rejected:
        objects.CreateObject(request)
    assert rejected.value.code() == grpc.StatusCode.ALREADY_EXISTS


def test_a_repeated_request_answers_the_object_it_created(objects):
    request = object_service_pb2.CreateObjectRequest(
        object_id="repeated",
        mesh=BOX_OBJ.encode(),
        unit_metres=0.01,
        mass_kg=0.1,
        labels={"level": "kitchen", "fragile": ""},
        request_id=str(uuid.uuid4()),
    )
    first = objects.CreateObject(request).object
    assert objects.CreateObject(request).object.etag == first.etag
    assert dict(first.labels) == {"level": "kitchen", "fragile": ""}
    age = time.time() - first.create_time.ToSeconds()
    assert -1 <= age < 300


def test_updates_what_the_mask_names_and_deletes(objects):
    created = objects.CreateObject(
        object_service_pb2.CreateObjectRequest(
            object_id="changing", mesh=BOX_OBJ.encode(), unit_metres=0.01, mass_kg=0.1, friction=0.9
        )
    ).object
    request = object_service_pb2.UpdateObjectRequest(
        name=created.name, mass_kg=0.2, labels={"level": "cellar"}, etag=created.etag
    )
    request.update_mask.paths.extend(["mass_kg", "labels", "friction"])
    changed = objects.UpdateObject(request).object
    assert changed.mass_kg == pytest.approx(0.2)
    assert not changed.HasField("friction")
    with pytest.raises(grpc.RpcError) as rejected:
        objects.UpdateObject(request)
    assert rejected.value.code() == grpc.StatusCode.ABORTED
    listed = objects.ListObjects(object_service_pb2.ListObjectsRequest(filter="level=cellar")).objects
    assert [o.name for o in listed] == [created.name]
    objects.DeleteObject(object_service_pb2.DeleteObjectRequest(name=created.name, etag=changed.etag))
    with pytest.raises(grpc.RpcError) as rejected:
        objects.GetObject(object_service_pb2.GetObjectRequest(name=created.name))
    assert rejected.value.code() == grpc.StatusCode.NOT_FOUND


def upload_parts(object_id, mesh, sha256):
    header = object_service_pb2.UploadHeader(
        object=object_service_pb2.CreateObjectRequest(object_id=object_id, unit_metres=0.01, mass_kg=0.1),
        total_bytes=len(mesh),
    )
    yield object_service_pb2.UploadObjectRequest(header=header)
    for start in range(0, len(mesh), 100):
        yield object_service_pb2.UploadObjectRequest(piece=mesh[start : start + 100])
    yield object_service_pb2.UploadObjectRequest(sha256=sha256)


def test_uploads_in_pieces_and_returns_the_mesh(objects):
    mesh = BOX_OBJ.encode()
    with pytest.raises(grpc.RpcError) as rejected:
        objects.UploadObject(upload_parts("uploaded", mesh, hashlib.sha256(b"other").hexdigest()))
    assert rejected.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    uploaded = objects.UploadObject(upload_parts("uploaded", mesh, hashlib.sha256(mesh).hexdigest())).object
    assert uploaded.triangle_count == 12
    header, *pieces = objects.GetMesh(object_service_pb2.GetMeshRequest(name=uploaded.name))
    glb = b"".join(part.piece for part in pieces)
    assert glb.startswith(b"glTF")
    assert (len(glb), hashlib.sha256(glb).hexdigest()) == (header.header.total_bytes, header.header.sha256)


def test_watches_objects(objects):
    watch = objects.WatchObjects(object_service_pb2.WatchObjectsRequest(filter="watched", include_present=True))
    end = next(watch)
    assert list(end.changes) == [object_service_pb2.OBJECT_CHANGE_PRESENT_END]
    request = object_service_pb2.CreateObjectRequest(
        object_id="watched", mesh=BOX_OBJ.encode(), unit_metres=0.01, mass_kg=0.1, labels={"watched": ""}
    )
    objects.CreateObject(request)
    news = next(watch)
    assert news.object.name == "objects/watched"
    assert object_service_pb2.OBJECT_CHANGE_CREATED in news.changes
    watch.cancel()


def test_reports_all_violations_at_once(grasps):
    request = find_grasp_pb2.FindGraspRequest(
        object="objects/remote",
        client_from_object=geometry_pb2.Pose(
            position=geometry_pb2.Vector3(x=float("nan")), orientation=geometry_pb2.Quaternion()
        ),
        budget=Duration(seconds=-1),
        up=geometry_pb2.Vector3(),
    )
    with pytest.raises(grpc.RpcError) as rejected:
        grasps.FindGrasp(request)
    assert rejected.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    (bad_request,) = details(rejected.value, error_details_pb2.BadRequest)
    fields = {violation.field for violation in bad_request.field_violations}
    assert {"client_from_object.position", "client_from_object.orientation", "budget", "up"} <= fields
    assert details(rejected.value, error_details_pb2.ErrorInfo)


def test_unknown_object_is_not_found(grasps):
    with pytest.raises(grpc.RpcError) as rejected:
        grasps.FindGrasp(find_grasp_pb2.FindGraspRequest(object="objects/teapot"))
    assert rejected.value.code() == grpc.StatusCode.NOT_FOUND
    (resource,) = details(rejected.value, error_details_pb2.ResourceInfo)
    assert resource.resource_name == "objects/teapot"


def unanswerable(**settings):
    """A request that no attempt can satisfy."""
    return find_grasp_pb2.FindGraspRequest(object="objects/slippery", seed=7, **settings)


@pytest.fixture(scope="module")
def slippery(objects):
    objects.CreateObject(
        object_service_pb2.CreateObjectRequest(
            object_id="slippery",
            mesh=BOX_OBJ.encode(),
            unit_metres=0.01,
            mass_kg=0.1,
            # All twelve triangles are forbidden, so nothing can be touched.
            forbidden=object_service_pb2.ForbiddenSurfaces(triangles=range(12)),
        )
    )


def test_exhausted_budget_returns_a_report(grasps, slippery):
    answer = grasps.FindGrasp(unanswerable(budget=Duration(nanos=50_000_000)), timeout=5)
    assert answer.outcome == find_grasp_pb2.OUTCOME_BUDGET_EXHAUSTED
    assert not answer.HasField("grasp")
    assert answer.report.attempts == sum(r.count for r in answer.report.rejections) > 0
    assert answer.report.HasField("nearest_miss")


def test_deadline_bounds_the_search(grasps, slippery):
    answer = grasps.FindGrasp(unanswerable(budget=Duration(seconds=9)), timeout=1)
    assert answer.outcome == find_grasp_pb2.OUTCOME_BUDGET_EXHAUSTED
    budget = answer.report.budget
    assert budget.seconds + budget.nanos * 1e-9 < 1


def test_cancelled_call_frees_the_server(grasps, slippery):
    call = grasps.FindGrasp.future(unanswerable(budget=Duration(seconds=9)))
    time.sleep(0.2)
    call.cancel()
    answer = grasps.FindGrasp(unanswerable(budget=Duration(nanos=50_000_000)), timeout=5)
    assert answer.outcome == find_grasp_pb2.OUTCOME_BUDGET_EXHAUSTED


def wait_for_complete_atlas(objects, name):
    """Answers are reproducible from then on. Unless target/atlases has the atlas, it has to grow first."""
    deadline = time.monotonic() + 300
    request = object_service_pb2.GetObjectRequest(name=name)
    while not objects.GetObject(request).object.atlas.complete:
        assert time.monotonic() < deadline, f"the atlas of {name} is not complete"
        time.sleep(0.05)


def test_reproducible_answer_repeats(objects, grasps):
    wait_for_complete_atlas(objects, "objects/scissors")
    request = find_grasp_pb2.FindGraspRequest(
        object="objects/scissors", budget=Duration(seconds=9), seed=3, reproducible=True
    )
    first, second = (grasps.FindGrasp(request, timeout=20) for _ in range(2))
    assert first.outcome == find_grasp_pb2.OUTCOME_FOUND
    assert first.grasp == second.grasp
    assert first.report.attempt == second.report.attempt
