"""All of the add-on in Blender without a window: test_blender.py runs this with bpy's Python, and GRASP_ADDRESS for the server.

GRASP_PICTURE names a PNG that keeps the picture of the last test.
"""

import base64
import json
import math
import os
import pathlib
import re
import struct
import sys
import time
import types
import unittest.mock

import bpy
import pytest
import yaml
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "client/blender"))

import grasp_blender  # noqa: E402
from grasp_blender import axes, connect, glb, hands, kinematics, messages, motion, objects  # noqa: E402
from grasp_blender import recordings, scenes, session  # noqa: E402
from grasp_blender.axes import BLENDER  # noqa: E402

ADDRESS = os.environ["GRASP_ADDRESS"]
GOLDEN = json.loads((ROOT / "proto/golden/grasps.json").read_text())
LEFT, RIGHT = kinematics.HANDEDNESSES
# A shape without symmetry: three arms of different lengths along the axes, of its file.
CHIRAL = ((0.12, 0.02, 0.02), (0.02, 0.16, 0.02), (0.02, 0.02, 0.09))


@pytest.fixture(autouse=True)
def scene():
    """An empty file with the add-on and the server's address."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    grasp_blender.register()
    bpy.context.scene.grasp.address = f"http://{ADDRESS}"
    bpy.context.scene.grasp.budget = 5
    yield bpy.context.scene
    grasp_blender.unregister()


def settings():
    return bpy.context.scene.grasp


def client():
    return connect.Client(ADDRESS)


def imported(name, as_name):
    """A built-in object's mesh, whose importer turns the object, not the mesh; moved and turned."""
    bpy.ops.wm.obj_import(filepath=str(ROOT / f"assets/objects/{name}.obj"))
    bpy.ops.object.transform_apply()
    item = bpy.context.object
    item.name = as_name
    item.grasp.mass_kg, item.grasp.friction = 0.1, 0.6
    item.location, item.rotation_euler = (0.3, -0.2, 1.1), (0.5, 1.0, 2.0)
    bpy.context.view_layer.update()
    return item


def boxes(name, sizes=CHIRAL):
    """A mesh of boxes with one corner at the origin, +Z up."""
    vertices, faces = [], []
    for size in sizes:
        first = len(vertices)
        vertices += [tuple(size[axis] * (corner >> axis & 1) for axis in range(3)) for corner in range(8)]
        quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
        faces += [tuple(first + corner for corner in quad) for quad in quads]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    bpy.context.view_layer.update()
    return item


def found():
    """The grasp that is shown."""
    return json.loads(settings().found[settings().chosen].json)


def in_world(item, point):
    """A point of an object's frame in Blender's world, in its units."""
    return scenes.frame(item) @ (Vector(BLENDER.point_from_openxr(point)) * scenes.units_per_meter(bpy.context))


def meters(a, b):
    return (Vector(a) - Vector(b)).length * bpy.context.scene.unit_settings.scale_length


def surface(item):
    """The evaluated mesh of an object in the world."""
    bpy.context.view_layer.update()
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    return BVHTree.FromPolygons([evaluated.matrix_world @ v.co for v in mesh.vertices], [p.vertices for p in mesh.polygons])


def shown(role):
    """The armature that is shown of a role."""
    armatures = [item for item in bpy.data.objects if item.get("grasp_hand", "").startswith(role)]
    return next((armature for armature in armatures if not armature.hide_viewport), None)


def assert_posed(item, armature, joints):
    """Every bone is at its joint, within 0.1 mm and 0.1 degrees."""
    bpy.context.view_layer.update()
    for name, joint in list(zip(kinematics.JOINT_NAMES, joints, strict=True))[1:]:
        bone = armature.matrix_world @ armature.pose.bones[name].matrix
        assert meters(bone.to_translation(), in_world(item, joint[0])) < 1e-4, name
        wanted = scenes.frame(item) @ scenes.matrix(bpy.context, joint)
        assert bone.to_quaternion().rotation_difference(wanted.to_quaternion()).angle % (2 * math.pi) < 0.002, name


def assert_touches(item, armature, grasp):
    """The contacts lie on the object within 0.1 mm. Those of fingertips are no more than 1 mm outside of the skin, and no more
    than 3 mm inside, of which flesh yields by 2; others may be a few millimeters off, where the skin folds."""
    mesh, skin = surface(item), surface(next(child for child in armature.children if child.type == "MESH"))
    assert grasp["contacts"]
    for contact in grasp["contacts"]:
        point = in_world(item, contact["position"])
        assert meters(point, mesh.find_nearest(point)[0]) < 1e-4
        nearest, normal, _, _ = skin.find_nearest(point)
        outside = meters(point, nearest) * (1 if (point - nearest).dot(normal) > 0 else -1)
        fold = 0 if contact["phalanx"] == 3 else 4e-3
        assert -3e-3 - fold < outside < 1e-3 + fold, (contact["digit"], contact["phalanx"], outside)


def test_a_grasp_is_shown_at_an_object():
    item = imported("scissors", "Shears")
    assert bpy.ops.grasp.status() == {"FINISHED"}
    assert bpy.context.window_manager.grasp_status.startswith("Ready")
    assert bpy.ops.grasp.find() == {"FINISHED"}
    grasp = found()
    assert_posed(item, shown("receiver"), grasp["hand"]["joints"])
    assert_touches(item, shown("receiver"), grasp)
    empties = [empty for empty in bpy.data.objects if empty.name.startswith("Grasp contact")]
    assert len(empties) == len(grasp["contacts"])
    for empty, contact in zip(sorted(empties, key=lambda e: e.name), sorted(grasp["contacts"], key=lambda c: c["digit"])):
        assert min(meters(empty.matrix_world.translation, in_world(item, c["position"])) for c in grasp["contacts"]) < 1e-5
    # Everything follows the object.
    item.location.x += 1
    bpy.context.view_layer.update()
    assert_posed(item, shown("receiver"), grasp["hand"]["joints"])
    # Asked again, there is one hand.
    bpy.ops.grasp.find()
    skins = [child for child in bpy.data.objects if child.name.startswith("Grasp receiver") and child.type == "MESH"]
    assert sum(not skin.hide_viewport for skin in skins) == 1


@pytest.mark.parametrize("vector", GOLDEN["vectors"], ids=lambda vector: vector["name"])
def test_golden_grasps_are_posed(vector):
    item = imported(vector["name"].split("-")[0], "Golden")
    for one in vector["conventions"]:
        given = recordings.Holdout(one["request"]["holdout"], one["convention"])
        grasp = session.in_object(one["answer"]["grasps"][0], given)
        armature = session.show_receiver(bpy.context, item, grasp["hand"])[0]
        assert_posed(item, armature, grasp["hand"]["joints"])
        assert_touches(item, armature, grasp)
        session.show_giver(bpy.context, item, given)
        handedness, joints = recordings.giver_joints(client(), given)
        assert handedness == RIGHT
        assert_posed(item, shown("giver"), joints)


def test_a_golden_request_is_answered_alike():
    one = GOLDEN["vectors"][0]["conventions"][0]
    answer = client().call("GraspService/FindGrasp", one["request"])
    for grasp, golden in zip(answer["grasps"], one["answer"]["grasps"], strict=True):
        assert {key: grasp[key] for key in golden} == golden


@pytest.mark.parametrize("convention", sorted(axes.CONVENTIONS))
def test_answers_in_every_convention_are_shown_alike(convention):
    one = GOLDEN["vectors"][5]["conventions"][0]
    hand = {key: value for key, value in one["answer"]["grasps"][0]["hand"].items() if key not in ("joints", "clientFromWrist")}
    holdout = {"object": one["request"]["holdout"]["object"], "clientFromObject": {"position": {"x": 1, "y": 2, "z": 3}}}

    def shown_in(convention):
        request = {"holdout": holdout, "pose": hand, "output": {"convention": convention}}
        answer = client().call("GraspService/ValidateGrasp", request)
        return session.in_object(answer["grasp"], recordings.Holdout(holdout, convention))

    grasp, expected = shown_in(convention), shown_in("CONVENTION_OPENXR")
    for joint, same in zip(grasp["hand"]["joints"], expected["hand"]["joints"], strict=True):
        assert math.dist(joint[0], same[0]) < 1e-5
        assert abs(abs(sum(a * b for a, b in zip(joint[1], same[1]))) - 1) < 1e-6
    assert len(grasp["contacts"]) == len(expected["contacts"]) > 1
    for contact, same in zip(grasp["contacts"], expected["contacts"]):
        assert math.dist(contact["position"], same["position"]) < 1e-5
        assert math.dist(contact["normal"], same["normal"]) < 1e-5


@pytest.mark.parametrize("case", ["as is", "scaled", "mirrored", "modified", "centimeters"])
def test_contacts_of_a_chiral_shape_lie_on_it(case):
    item = boxes(f"Chiral {case}")
    if case == "scaled":
        item.scale = (0.5, 0.8, 1.5)
    if case == "mirrored":
        item.scale = (-1, 1, 1)
    if case == "modified":
        item.modifiers.new("Bevel", "BEVEL").width = 0.004
    if case == "centimeters":
        bpy.context.scene.unit_settings.scale_length = 0.01
        item.scale = (100, 100, 100)
    item.location, item.rotation_euler = (1.0, 2.0, 3.0), (0.3, -1.2, 2.5)
    bpy.context.view_layer.update()
    bpy.ops.grasp.find()
    grasp = found()
    assert_posed(item, shown("receiver"), grasp["hand"]["joints"])
    assert_touches(item, shown("receiver"), grasp)
    # Not inside out, for one; boxes do meet at edges.
    assert all("edges join" in warning for warning in item.grasp.warnings.splitlines())


def test_marked_faces_are_not_touched():
    item = boxes("Marked")
    attribute = item.data.attributes.new("forbidden", "BOOLEAN", "FACE")
    attribute.data.foreach_set("value", [face < 6 for face in range(18)])
    group = item.vertex_groups.new(name="preferred")
    group.add(range(8, 16), 1.0, "REPLACE")
    bpy.ops.grasp.find()
    present = client().call("ObjectService/GetObject", {"name": "objects/marked"})
    regions = {region["name"]: region["triangles"] for region in present["regions"]}
    assert regions == {"forbidden": list(range(12)), "preferred": list(range(12, 24))}
    assert present["forbiddenTriangleCount"] == 12
    # No contact is on the arm along x.
    for contact in found()["contacts"]:
        x, y, z = BLENDER.point_from_openxr(contact["position"])
        assert not (x > 0.0205 and y < 0.0201 and z < 0.0201), contact
    attribute.data.foreach_set("value", [False] * 18)
    item.data.update()
    bpy.ops.grasp.upload()
    present = client().call("ObjectService/GetObject", {"name": "objects/marked"})
    assert [region["name"] for region in present["regions"]] == ["preferred"]


def test_givers_of_files_recordings_and_armatures_are_kept_clear_of(tmp_path):
    item = imported("remote", "Held Remote")
    file = tmp_path / "giver.json"
    one = GOLDEN["vectors"][3]["conventions"][1]
    file.write_text(json.dumps(one["request"]))
    settings().giver, settings().giver_file = "FILE", str(file)
    bpy.ops.grasp.find()
    assert_posed(item, shown("receiver"), found()["hand"]["joints"])
    giver, handedness = shown("giver"), RIGHT
    joints = recordings.giver_joints(client(), recordings.read_giver(file))[1]
    assert_posed(item, giver, joints)

    settings().giver, settings().giver_armature, settings().giver_hand = "ARMATURE", giver, handedness
    read = hands.giver_of(bpy.context, giver, handedness, item)["joints"]
    for name, joint, exact in zip(kinematics.JOINT_NAMES, read, joints, strict=True):
        assert math.dist(messages.pose(joint["pose"])[0], exact[0]) < 1e-3, name
        turn = axes.product(axes.conjugate(messages.pose(joint["pose"])[1]), exact[1])
        # Axes follow from places: those of the thumb roughly.
        assert 2 * math.acos(min(1, abs(turn[3]))) < (0.9 if name.startswith("thumb") else 0.35), name
    bpy.ops.grasp.find()
    assert_touches(item, shown("receiver"), found())

    recorded = tmp_path / "recording.json"
    recorded.write_text(json.dumps(motion_of(one["request"]["holdout"], "CONVENTION_UNITY", 3)))
    settings().giver, settings().giver_file = "RECORDING", str(recorded)
    bpy.context.scene.frame_set(3)
    assert session.holdout(bpy.context, item).message["clientFromObject"]["position"]["y"] == 0.02
    bpy.ops.grasp.find()
    assert_touches(item, shown("receiver"), found())


def motion_of(holdout, convention, count):
    """A recording of a giver who lifts the object by a centimeter per frame, 24 times a second."""
    frames = []
    for index in range(count):
        moved = json.loads(json.dumps(holdout))
        for pose in (moved["clientFromObject"], moved["presentingHand"]["pose"]["clientFromWrist"]):
            pose.setdefault("position", {})["y"] = pose["position"].get("y", 0) + 0.01 * index
        if index:
            moved["clientFromObject"]["position"]["y"] = 0.01 * index
        frames.append({"captureTime": f"{index / 24:.6f}s", "holdout": moved})
    return {"track": {"holdout": {"object": "objects/remote"}, "output": {"convention": convention}}, "frames": frames}


def test_a_recording_is_keyed_per_frame(tmp_path):
    item = imported("remote", "Moved Remote")
    file = tmp_path / "recording.json"
    file.write_text(json.dumps(motion_of(GOLDEN["vectors"][3]["conventions"][0]["request"]["holdout"], "CONVENTION_OPENXR", 12)))
    settings().giver, settings().giver_file, settings().hand = "RECORDING", str(file), LEFT
    assert bpy.ops.grasp.track() == {"FINISHED"}
    recording = recordings.read_recording(file)
    receiver, giver = shown("receiver"), shown("giver")
    for owner in (item, receiver, giver):
        assert {len(curve.keyframe_points) for curve in motion.curves(owner)} == {12}
        turns = {}
        for curve in motion.curves(owner):
            if curve.data_path.endswith("rotation_quaternion"):
                turns.setdefault(curve.data_path, []).append([point.co.y for point in curve.keyframe_points])
        for path, parts in turns.items():
            quaternions = list(zip(*parts))
            assert all(sum(map(float.__mul__, a, b)) > 0 for a, b in zip(quaternions, quaternions[1:])), path
    clear = []
    for index, (seconds, _) in enumerate(recording.frames):
        bpy.context.scene.frame_set(1 + index)
        given = recording.holdout_at(seconds)
        assert meters(item.matrix_world.translation, scenes.matrix(bpy.context, given.client_from_object()).translation) < 1e-5
        assert_posed(item, giver, recordings.giver_joints(client(), given)[1])
        clear.append(surface(receiver.children[0]).overlap(surface(giver.children[0])))
    assert not any(clear)


def test_grasps_that_differ_are_listed_and_chosen():
    item = imported("scissors", "Many Shears")
    settings().alternatives, settings().budget = 3, 1
    bpy.ops.grasp.find()
    assert len(settings().found) == 3
    assert len({(entry.json) for entry in settings().found}) == 3
    for index in range(3):
        settings().chosen = index
        assert_posed(item, shown("receiver"), found()["hand"]["joints"])


def test_known_grips_are_kept_listed_banned_and_removed():
    item = imported("scissors", "Known Shears")
    settings().hand = LEFT
    bpy.ops.grasp.find()
    kept = found()
    assert bpy.ops.grasp.keep(name="by the blades") == {"FINISHED"}
    manager = bpy.context.window_manager
    assert [(grip.name, grip.preferred) for grip in manager.grasp_known] == [("by the blades", True)]
    # It is on the server, and answered there.
    grips = client().call("ObjectService/GetObject", {"name": "objects/known-shears"})["knownGrips"]
    wrists = [messages.pose(hand["objectFromWrist"])[0] for hand in (grips[0]["hand"], kept["hand"])]
    assert math.dist(*wrists) < 1e-5
    request = {"holdout": {"object": "objects/known-shears"}, "receiver": {"handedness": LEFT}}
    answer = client().call("GraspService/FindGrasp", request)
    assert answer["origin"]["knownGrip"] == "by the blades"
    assert bpy.ops.grasp.show_known() == {"FINISHED"}
    assert_posed(item, shown("receiver"), kept["hand"]["joints"])
    bpy.ops.grasp.prefer()
    assert not manager.grasp_known[0].preferred
    answer = client().call("GraspService/FindGrasp", request)
    wrist = messages.pose(answer["grasps"][0]["hand"]["objectFromWrist"])
    banned = messages.pose(kept["hand"]["objectFromWrist"])
    turn = axes.product(axes.conjugate(wrist[1]), banned[1])
    assert math.dist(wrist[0], banned[0]) > 0.029 or 2 * math.acos(min(1, abs(turn[3]))) > 0.49
    # A mesh that changes keeps its grips.
    item.scale = (1.1, 1.1, 1.1)
    bpy.context.view_layer.update()
    bpy.ops.grasp.upload()
    assert [grip.name for grip in manager.grasp_known] == ["by the blades"]
    bpy.ops.grasp.forget()
    bpy.ops.grasp.known()
    assert not manager.grasp_known
    assert "knownGrips" not in client().call("ObjectService/GetObject", {"name": "objects/known-shears"})


def test_the_motion_to_a_grasp_is_keyed_and_exported(tmp_path):
    item = imported("remote", "Keyed Remote")
    bpy.ops.grasp.find()
    grasp = found()
    bpy.context.scene.frame_set(10)
    assert bpy.ops.grasp.key() == {"FINISHED"}
    armature = shown("receiver")
    assert [point.co.x for point in motion.curves(armature)[0].keyframe_points] == [10, 22, 34]
    for frame, (kind, hand) in zip((10, 22, 34), grasp["keyFrames"], strict=True):
        bpy.context.scene.frame_set(frame)
        assert_posed(item, armature, hand["joints"])
    ways = [in_world(item, hand["joints"][1][0]) for _, hand in grasp["keyFrames"]]
    bpy.context.scene.frame_set(16)
    bpy.context.view_layer.update()
    assert meters(armature.matrix_world.translation, ways[0].lerp(ways[1], 0.5)) < 1e-4
    file = tmp_path / "grasp.glb"
    bpy.ops.export_scene.gltf(filepath=str(file))
    document, _ = glb.unpacked(file.read_bytes())
    assert len(document["animations"][0]["channels"]) >= 50
    assert {"wrist", "thumb-tip"} <= {node["name"] for node in document["nodes"]}


def test_undo_takes_a_grasp_back():
    imported("scissors", "Undone Shears")
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.grasp.find()
    bpy.ops.ed.undo_push(message="after")
    assert shown("receiver") and len(settings().found) == 1
    bpy.ops.ed.undo()
    assert shown("receiver") is None and not settings().found
    assert not [item for item in bpy.data.objects if item.name.startswith("Grasp")]
    bpy.ops.ed.redo()
    assert shown("receiver") and len(settings().found) == 1


def test_errors_name_every_wrong_field():
    item = imported("scissors", "Wrong Shears")
    settings().hand = LEFT
    with pytest.raises(connect.GraspError) as raised:
        client().call("GraspService/FindGrasp", {"holdout": {"object": "objects/remote", "scale": 9, "massKg": -1}})
    assert raised.value.code == "invalid_argument"
    assert [field for field, _ in raised.value.violations] == ["holdout.scale", "holdout.mass_kg"]
    item.grasp.identifier = "scissors"
    with pytest.raises(RuntimeError, match="another program"):
        bpy.ops.grasp.find()
    item.grasp.identifier = ""
    bpy.ops.grasp.find()
    with pytest.raises(RuntimeError, match="known_grips.*name"):
        bpy.ops.grasp.keep(name="\n")
    item.grasp.mass_kg = 900
    settings().budget = 0.2
    with pytest.raises(RuntimeError, match="kg"):
        bpy.ops.grasp.find()
    settings().address = "http://127.0.0.1:9"
    with pytest.raises(RuntimeError, match="No server at http://127.0.0.1:9"):
        bpy.ops.grasp.find()
    settings().address = "http://grasp.example:50051"
    with pytest.raises(RuntimeError, match="Online Access"):
        bpy.ops.grasp.find()


def test_a_folder_is_baked(tmp_path):
    for name in ("remote", "scalpel"):
        text = (ROOT / f"assets/objects/{name}.obj").read_bytes()
        (tmp_path / f"my {name}.obj").write_bytes(text)
    (tmp_path / "my scalpel.toml").write_text(
        'mass_kg = 0.02\n[[regions]]\nname = "edge"\npreference = "forbidden"\ngroups = ["blade_edge"]\n'
        '[[regions]]\nname = "tip"\npreference = "avoided"\nshapes = [{ tube = { points = [[0, 0.08, 0]], radii = [0.01] } }]\n'
    )
    (tmp_path / "broken.stl").write_text("solid nothing")
    settings().formats = {"json", "isaac"}
    settings().alternatives, settings().budget = 2, 1
    settings().folder = str(tmp_path)
    assert bpy.ops.grasp.bake() == {"FINISHED"}
    for name in ("remote", "scalpel"):
        content = json.loads((tmp_path / f"my {name}.grasps.json").read_text())
        assert content["object"] == f"objects/my-{name}" and len(content["grasps"]) == 2
        # Another client's server takes what was baked.
        for grasp in content["grasps"]:
            hand = {key: value for key, value in grasp["hand"].items() if key not in ("joints", "model")}
            assert client().call("GraspService/ValidateGrasp", {"holdout": {"object": content["object"]}, "pose": hand})["valid"]
        isaac = [yaml.safe_load(file.read_text()) for file in sorted(tmp_path.glob(f"my {name}.grasps.*.yaml"))]
        for file in isaac:
            assert (file["format"], str(file["format_version"])) == ("isaac_grasp", "1.0")
            assert file["gripper_frame"] in ("rigs/adult/left", "rigs/adult/right")
        pairs = [
            (grasp, written)
            for file in isaac
            for grasp, written in zip(
                (grasp for grasp in content["grasps"] if grasp["hand"]["handedness"].lower().endswith(file["gripper_frame"][11:])),
                file["grasps"].values(),
                strict=True,
            )
        ]
        assert len(pairs) == 2
        for grasp, written in pairs:
            position, orientation = messages.pose(grasp["hand"]["objectFromWrist"])
            assert math.dist(written["position"], position) < 1e-6
            assert math.dist((*written["orientation"]["xyz"], written["orientation"]["w"]), orientation) < 1e-6
            assert written["confidence"] == pytest.approx(grasp["score"], abs=1e-5)
            assert len(written["cspace_position"]) == 20
            # Where a free way leads to the grasp.
            assert len(written.get("pregrasp_cspace_position", ())) == (20 if "keyFrames" in grasp else 0)
    scalpel = client().call("ObjectService/GetObject", {"name": "objects/my-scalpel"})
    assert scalpel["massKg"] == pytest.approx(0.02) and scalpel["forbiddenTriangleCount"] > 0
    assert not (tmp_path / "broken.grasps.json").exists()
    # Baked again, objects stay as they are.
    etag = scalpel["etag"]
    bpy.ops.grasp.bake()
    assert client().call("ObjectService/GetObject", {"name": "objects/my-scalpel"})["etag"] == etag
    for folder, message in ((str(ROOT / "client/blender"), "no meshes"), ("", "no folder"), ("/none", "no folder")):
        settings().folder = folder
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.grasp.bake()


@pytest.mark.parametrize("heuristic, scale", [("TEMPERANCE", 1.0), ("BLENDER", 0.01)])
def test_an_armature_of_ones_own_takes_objects(heuristic, scale):
    item = imported("remote", "Own Remote")
    bpy.ops.import_scene.gltf(
        filepath=str(ROOT / "assets/hands/adult_right.glb"), bone_heuristic=heuristic, disable_bone_shape=True
    )
    own = bpy.context.object if bpy.context.object.type == "ARMATURE" else bpy.context.object.parent
    own.name, own.scale = f"Own {heuristic.title()}", (scale,) * 3
    for data in (own.data, own.children[0].data):
        data.transform(Matrix.Scale(1 / scale, 4))
    # A bone with a name of its own.
    own.data.bones["wrist"].name = "Paw"
    own.data.bones["Paw"]["joint"] = "wrist"
    bpy.context.view_layer.objects.active = item
    settings().armature, settings().hand = own, RIGHT
    with pytest.raises(RuntimeError, match="Create Rig"):
        bpy.ops.grasp.find()
    without_rig(own.name.lower().replace(" ", "-"))
    bpy.context.view_layer.objects.active = own
    bpy.ops.object.mode_set(mode="POSE")
    bpy.ops.grasp.create_rig()
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = item
    # Sent again by the same armature, it is replaced; from elsewhere, it is not.
    bpy.ops.grasp.create_rig()
    noted = own.pop("grasp_rig")
    with pytest.raises(RuntimeError, match="another armature's"):
        bpy.ops.grasp.create_rig()
    own["grasp_rig"] = noted
    # A right hand only, which "either" is then.
    settings().hand = LEFT
    with pytest.raises(RuntimeError, match="no left hand"):
        bpy.ops.grasp.find()
    settings().hand = "HANDEDNESS_UNSPECIFIED"
    for _ in range(2):
        bpy.ops.grasp.find()
        grasp = found()
        bpy.context.view_layer.update()
        for name, joint in zip(kinematics.JOINT_NAMES, grasp["hand"]["joints"], strict=True):
            # The rig has its tips on the skin, and bones of the palm at its own places.
            if name != "palm" and not name.endswith("tip") and "finger-metacarpal" not in name:
                bone = own.matrix_world @ own.pose.bones["Paw" if name == "wrist" else name].head
                assert meters(bone, in_world(item, joint[0])) < 1e-3, name
        assert_touches(item, own, grasp)


def without_rig(name):
    """Deletes a rig of an earlier run with the same server."""
    try:
        client().call("HandRigService/DeleteRig", {"name": f"rigs/{name}"})
    except connect.GraspError as error:
        assert error.code == "not_found"


def character():
    """A hand on an arm: the built-in hand's bones under an upper arm and a forearm."""
    bpy.ops.import_scene.gltf(filepath=str(ROOT / "assets/hands/adult_left.glb"), disable_bone_shape=True)
    own = bpy.context.object if bpy.context.object.type == "ARMATURE" else bpy.context.object.parent
    own.name = "Character"
    bpy.context.view_layer.objects.active = own
    bpy.ops.object.mode_set(mode="EDIT")
    bones = own.data.edit_bones
    upper, forearm, wrist = bones.new("upperarm_l"), bones.new("lowerarm_l"), bones["wrist"]
    elbow = wrist.head + Vector((0.02, -0.26, 0))
    upper.head, upper.tail = elbow + Vector((0.1, -0.28, 0)), elbow
    forearm.head, forearm.tail = elbow, wrist.head
    forearm.parent, forearm.use_connect, wrist.parent = upper, True, forearm
    bpy.ops.object.mode_set(mode="OBJECT")
    return own


def test_the_arm_of_a_character_follows():
    item = imported("remote", "Taken Remote")
    item.location = (0.1, -0.2, 0)
    own = character()
    without_rig("character")
    bpy.context.view_layer.objects.active = item
    settings().armature, settings().hand = own, LEFT
    bpy.ops.grasp.create_rig()
    bpy.ops.grasp.find()
    bpy.context.view_layer.update()
    evaluated = own.evaluated_get(bpy.context.evaluated_depsgraph_get())
    target = in_world(item, found()["hand"]["joints"][1][0])
    shoulder = own.matrix_world @ evaluated.pose.bones["upperarm_l"].head
    assert meters(shoulder, own.matrix_world @ own.data.bones["upperarm_l"].head_local) < 1e-5
    assert meters(shoulder, target) < 0.56, "the arm has to reach"
    for name, joint in zip(kinematics.JOINT_NAMES, found()["hand"]["joints"], strict=True):
        if name != "palm" and not name.endswith("tip") and "finger-metacarpal" not in name:
            assert meters(own.matrix_world @ evaluated.pose.bones[name].head, in_world(item, joint[0])) < 2e-3, name
    forearm, middle = evaluated.pose.bones["lowerarm_l"], evaluated.pose.bones["middle-finger-phalanx-proximal"]
    bend = (forearm.tail - forearm.head).angle(middle.head - forearm.tail)
    assert bend < math.radians(100), "the wrist bends as a wrist can"
    # Far away, no arm reaches.
    item.location = (1.5, 0, 0)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="reach"):
        bpy.ops.grasp.find()


def table_of_importers():
    """The rows of the README: file, importer, whether the server's object is z_up."""
    text = (ROOT / "client/blender/README.md").read_text()
    rows = re.findall(r"^\| ([^|]+) \| `(bpy\.ops[^`]+)` \| (no|yes) \|$", text, flags=re.MULTILINE)
    assert len(rows) == 7
    return rows


@pytest.mark.parametrize("kind, importer, z_up", table_of_importers())
def test_imported_files_have_the_frame_of_the_servers_object(kind, importer, z_up, tmp_path):
    file = str(tmp_path / f"shape.{kind[:3].lower()}")
    shape = boxes("Shape")
    shape.select_set(True)
    if kind.startswith("GLB"):
        bpy.ops.export_scene.gltf(filepath=file, use_selection=True)
    else:
        getattr(bpy.ops.wm, f"{kind[:3].lower()}_export")(filepath=file, forward_axis="Y", up_axis="Z")
    bpy.data.objects.remove(shape)
    exec(importer, {"bpy": bpy, "file": file})
    item = next(item for item in bpy.data.objects if item.type == "MESH")
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    bpy.ops.object.transform_apply()
    mesh, _ = scenes.mesh_of(bpy.context, item)
    name = objects.object_name(f"importer {kind} {z_up}")
    wanted = {"name": name, "massKg": 0.1, "zUp": z_up == "yes"}
    objects.ensure(client(), wanted, pathlib.Path(file).read_bytes())
    server = b"".join(base64.b64decode(part["piece"]) for part in client().stream("ObjectService/GetMesh", {"name": name}))
    assert points_of(mesh) == points_of(server)


def points_of(file):
    """The places of a GLB's vertices, in tenths of millimeters."""
    document, data = glb.unpacked(file)
    points = set()
    for primitive in (primitive for mesh in document["meshes"] for primitive in mesh["primitives"]):
        accessor = document["accessors"][primitive["attributes"]["POSITION"]]
        view = document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", 12)
        for vertex in range(accessor["count"]):
            points.add(tuple(round(1e4 * part) for part in struct.unpack_from("<3f", data, start + vertex * stride)))
    return points


@pytest.mark.parametrize("importer", ["import_scene.fbx", "wm.fbx_import"])
def test_fbx_files_keep_their_frame(importer, tmp_path):
    shape, file = boxes("Shape"), str(tmp_path / "shape.fbx")
    shape.select_set(True)
    before = points_of(scenes.mesh_of(bpy.context, shape)[0])
    bpy.ops.preferences.addon_enable(module="io_scene_fbx")
    bpy.ops.export_scene.fbx(filepath=file, use_selection=True)
    bpy.data.objects.remove(shape)
    group, operator = importer.split(".")
    getattr(getattr(bpy.ops, group), operator)(filepath=file)
    item = next(item for item in bpy.data.objects if item.type == "MESH")
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    bpy.ops.object.transform_apply()
    assert points_of(scenes.mesh_of(bpy.context, item)[0]) == before


class Layout:
    """Stands for a panel's layout: takes only what Blender's own takes, and checks that properties and operators exist."""

    def __init__(self, drawn):
        self.drawn = drawn

    def __getattr__(self, name):
        function = bpy.types.UILayout.bl_rna.functions[name]

        def draw(*arguments, **keywords):
            assert set(keywords) <= set(function.parameters.keys()), (name, keywords)
            if name == "prop":
                assert hasattr(arguments[0], arguments[1]), arguments
                self.drawn.append(arguments[1])
            if name == "operator":
                group, operator = arguments[0].split(".")
                getattr(getattr(bpy.ops, group), operator).get_rna_type()
                self.drawn.append(arguments[0])
            return self

        return draw


def test_every_panel_can_be_drawn():
    from grasp_blender import panel

    drawn = []

    def draw():
        for one in panel.CLASSES:
            if issubclass(one, panel.GraspPanel):
                fake = panel.GraspPanel()
                fake.layout = Layout(drawn)
                one.draw(fake, bpy.context)

    draw()
    imported("scissors", "Drawn Shears")
    bpy.ops.grasp.find()
    bpy.ops.grasp.keep(name="drawn")
    settings().armature = shown("receiver")
    for giver in ("FILE", "ARMATURE", "RECORDING"):
        settings().giver = giver
        draw()
    operators = {f"grasp.{name}" for name in dir(bpy.ops.grasp)}
    assert operators <= set(drawn), operators - set(drawn)


def test_long_operators_work_by_a_timer_and_end_by_escape():
    from grasp_blender import steps

    class Long(steps.Stepped):
        closed = False

        def steps(self, context):
            try:
                for step in range(1000):
                    time.sleep(0.01)
                    yield step / 1000
            finally:
                Long.closed = True

    manager = unittest.mock.Mock()
    context = types.SimpleNamespace(window_manager=manager, window=None)
    long = Long()
    assert long.invoke(context, None) == {"RUNNING_MODAL"}
    for _ in range(3):
        before = time.monotonic()
        assert long.modal(context, types.SimpleNamespace(type="TIMER")) == {"RUNNING_MODAL"}
        assert time.monotonic() - before < 1
    assert manager.progress_update.call_count >= 3
    assert long.modal(context, types.SimpleNamespace(type="A")) == {"RUNNING_MODAL"}
    assert long.modal(context, types.SimpleNamespace(type="ESC")) == {"CANCELLED"}
    assert Long.closed and manager.event_timer_remove.called and manager.progress_end.called


@pytest.mark.parametrize(
    "content, message",
    [
        ("{", "giver.json"),
        ("{}", "has no hand"),
        ('{"rig": "rigs/adult"}', "presenting_hand.*handedness"),
        ('{"rig": "rigs/none", "handedness": "HANDEDNESS_LEFT"}', "presenting_hand"),
        ('{"presentingHand": {"mesh": {}}}', "presenting_hand"),
        ('{"holdout": {"presentingHand": {}}, "output": {"convention": "CONVENTION_MAYA"}}', "it must be one of"),
    ],
)
def test_wrong_files_of_givers_are_named(content, message, tmp_path):
    imported("scissors", "Given Shears")
    file = tmp_path / "giver.json"
    file.write_text(content)
    settings().giver, settings().giver_file = "FILE", str(file)
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.grasp.find()
    settings().giver = "RECORDING"
    with pytest.raises(RuntimeError, match="recording|giver.json"):
        bpy.ops.grasp.track()


def test_a_picture_shows_a_handover(tmp_path):
    """The picture is to be looked at: GRASP_PICTURE keeps it."""
    item = imported("remote", "Drawn Remote")
    file = tmp_path / "giver.json"
    file.write_text(json.dumps(GOLDEN["vectors"][3]["conventions"][0]["request"]))
    settings().giver, settings().giver_file = "FILE", str(file)
    bpy.ops.grasp.find()
    kept = os.environ.get("GRASP_PICTURE")
    picture = kept or str(tmp_path / "picture.png")
    scene, at = bpy.context.scene, item.matrix_world.translation
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    light = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    for new in (camera, light):
        scene.collection.objects.link(new)
    wrists = [shown(role).matrix_world.translation for role in ("giver", "receiver")]
    across = (wrists[1] - wrists[0]).cross(Vector((0, 0, 1))).normalized()
    direction = (across + Vector((0, 0, 0.4))).normalized()
    camera.location = at + direction * 0.75
    camera.rotation_euler = (-direction).to_track_quat("-Z", "Y").to_euler()
    light.rotation_euler, light.data.energy = camera.rotation_euler, 3
    scene.camera, scene.render.filepath = camera, picture
    scene.render.engine, scene.cycles.samples = "CYCLES", 32 if kept else 1
    scene.render.resolution_x, scene.render.resolution_y = (960, 720) if kept else (96, 72)
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.5, 0.5, 0.5)
    bpy.ops.render.render(write_still=True)
    pixels = bpy.data.images.load(picture).pixels[:]
    assert len({tuple(round(part, 2) for part in pixels[i : i + 3]) for i in range(0, len(pixels), 4)}) > 50
