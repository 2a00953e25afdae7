"""Grasps, grips, recordings and folders in Blender without a window.

test_blender.py runs this with bpy's Python, and GRASP_ADDRESS for the server.
"""

from fixtures import *  # noqa: F403


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
