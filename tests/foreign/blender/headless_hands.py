"""Own hands and characters, importers and panels in Blender without a window.

test_blender.py runs this with bpy's Python, and GRASP_ADDRESS for the server. GRASP_PICTURE names a PNG that
keeps the picture of the last test.
"""

from fixtures import *  # noqa: F403


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
