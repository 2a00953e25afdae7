"""The Blender add-on: its conversions and files in any Python, and all of it in Blender, without a window."""

import base64
import json
import math
import os
import re
import subprocess
import sys

import pytest

from conftest import ROOT

ADD_ON = ROOT / "client/blender"
sys.path.insert(0, str(ADD_ON))

from grasp_blender import axes, bones, connect, isaac, kinematics, messages  # noqa: E402

PYTHON = ROOT / "target/foreign/blender/venv/bin/python"
README = (ADD_ON / "README.md").read_text()
GOLDEN = json.loads((ROOT / "proto/golden/grasps.json").read_text())
CONVENTIONS = {f"CONVENTION_{engine}" for engine in ("OPENXR", "UNITY", "UNREAL", "GODOT")}


def angle(a, b):
    """The angle between two rotations, in radians."""
    turn = axes.product(axes.conjugate(a), b)
    return 2 * math.atan2(math.hypot(*turn[:3]), abs(turn[3]))


def assert_near(a, b, meters=1e-5, radians=2e-5):
    assert math.dist(a[0], b[0]) < meters
    assert angle(a[1], b[1]) < radians


def in_object(one):
    """An answer's grasp as the add-on shows it."""
    holdout, convention = one["request"]["holdout"], one["convention"]
    client_from_object = axes.CONVENTIONS[convention].object_to_openxr(messages.pose(holdout.get("clientFromObject")))
    return messages.grasp_in_object(one["answer"]["grasps"][0], convention, client_from_object)


@pytest.mark.parametrize("vector", GOLDEN["vectors"], ids=lambda vector: vector["name"])
def test_golden_grasps_are_the_same_from_each_convention(vector):
    assert {one["convention"] for one in vector["conventions"]} == CONVENTIONS
    expected = in_object(next(one for one in vector["conventions"] if one["convention"] == "CONVENTION_OPENXR"))
    for one in vector["conventions"]:
        grasp = in_object(one)
        assert_near(*(messages.pose(hand["objectFromWrist"]) for hand in (grasp["hand"], expected["hand"])))
        assert len(grasp["hand"]["joints"]) == 26
        for joint, same in zip(grasp["hand"]["joints"], expected["hand"]["joints"], strict=True):
            assert_near(joint, same)
        assert grasp["contacts"]
        for contact, same in zip(grasp["contacts"], expected["contacts"], strict=True):
            assert math.dist(contact["position"], same["position"]) < 1e-5
            assert math.dist(contact["normal"], same["normal"]) < 1e-5
            assert math.dist(contact["force"], same["force"]) < 1e-4


@pytest.mark.parametrize("vector", GOLDEN["vectors"], ids=lambda vector: vector["name"])
def test_packed_grasps_have_the_hand_and_its_joints(vector):
    for one in vector["conventions"]:
        grasp = in_object(one)
        packed = base64.b64decode(one["answer"]["grasps"][0]["packed"])
        unpacked = kinematics.unpacked(packed)
        hand = messages.hand_in_object(unpacked["hand"], one["convention"], axes.IDENTITY)
        assert (hand["rig"], hand["handedness"]) == (grasp["hand"]["rig"], grasp["hand"]["handedness"])
        touching = {contact["digit"].removeprefix("DIGIT_").lower() for contact in grasp["contacts"]}
        assert {name.replace("palm", "unspecified") for name in unpacked["contacts"]} == touching
        for digit in messages.DIGITS:
            for decoded, exact in zip(*(kinematics.angles_of(posed[digit]) for posed in (hand, grasp["hand"]))):
                assert abs(decoded - exact) < math.radians(0.5)
        wrist = messages.pose(hand["objectFromWrist"])
        assert_near(wrist, messages.pose(grasp["hand"]["objectFromWrist"]), 5e-4, math.radians(0.5))
        for posed, meters in ((grasp["hand"], 1e-5), (hand, 5e-4)):
            at = messages.pose(posed["objectFromWrist"])
            joints = kinematics.joints_of(GOLDEN["rigs"][posed["rig"]], posed)
            for joint, exact in zip(joints, grasp["hand"]["joints"], strict=True):
                assert math.dist(axes.composed(at, joint)[0], exact[0]) < meters
    for wrong in (b"", packed[:30], b"\2" + packed[1:], packed + b"\0"):
        with pytest.raises(ValueError):
            kinematics.unpacked(wrong)


def test_axes_of_blender_go_to_openxr_and_back():
    pose = ((1.0, 2.0, 3.0), axes.product(axes.about(0, 0.3), axes.about(2, 1.2)))
    # As glTF is imported: +Y up becomes +Z up, and forward -Z becomes +Y.
    assert axes.BLENDER.point_from_openxr((1.0, 2.0, 3.0)) == (1.0, -3.0, 2.0)
    blender = axes.BLENDER.pose_from_openxr(pose)
    assert_near(axes.BLENDER.pose_to_openxr(blender), pose, 1e-12)
    # A turn takes points along in both.
    point = (0.1, 0.2, 0.3)
    moved = axes.composed(pose, (point, axes.IDENTITY[1]))[0]
    in_blender = axes.composed(blender, (axes.BLENDER.point_from_openxr(point), axes.IDENTITY[1]))[0]
    assert math.dist(axes.BLENDER.point_from_openxr(moved), in_blender) < 1e-12


@pytest.mark.parametrize("convention", sorted(axes.CONVENTIONS))
def test_conventions_are_their_own_inverse(convention):
    engine = axes.CONVENTIONS[convention]
    pose = ((1.0, 2.0, 3.0), axes.product(axes.about(0, 0.3), axes.about(1, 1.2)))
    assert_near(engine.pose_to_openxr(engine.pose_from_openxr(pose)), pose, 1e-12)


def test_isaac_files_are_in_the_axes_of_the_objects_file():
    wrist = {"position": {"x": 0.1, "y": 0.2, "z": 0.3}, "orientation": {"w": 1.0}}
    hand = {"rig": "rigs/adult", "handedness": "HANDEDNESS_RIGHT", "scale": 1.1, "objectFromWrist": wrist, "thumb": {}}
    files = isaac.files({"name": "objects/mug", "zUp": True}, [{"hand": hand, "score": 0.5}])
    assert list(files) == ["right"]
    lines = files["right"].splitlines()
    assert "gripper_frame: rigs/adult/right/1.1" in lines
    # The server makes (x, z, -y) of the file's (x, y, z).
    assert "    position: [0.1000000, -0.3000000, 0.2000000]" in lines
    assert "    orientation: {w: 0.70710678, xyz: [0.70710678, 0.00000000, 0.00000000]}" in lines


FINGERS = ("index", "middle", "ring", "little")
NAMES = {
    "WebXR": ("wrist", kinematics.JOINT_NAMES[2:6], [kinematics.JOINT_NAMES[first : first + 5] for first in (6, 11, 16, 21)]),
    "OpenXR": (
        "L_Wrist",
        ["L_ThumbMetacarpal", "L_ThumbProximal", "L_ThumbDistal", "L_ThumbTip"],
        [[f"L_{f.title()}{part}" for part in ("Metacarpal", "Proximal", "Intermediate", "Distal", "Tip")] for f in FINGERS],
    ),
    "Rigify": (
        "DEF-hand.L",
        [f"DEF-thumb.{i:02}.L" for i in (1, 2, 3)],
        [[f"DEF-f_{f.replace('little', 'pinky')}.{i:02}.L" for i in (1, 2, 3)] for f in FINGERS],
    ),
    "Mixamo": (
        "mixamorig:LeftHand",
        [f"mixamorig:LeftHandThumb{i}" for i in (1, 2, 3, 4)],
        [[f"mixamorig:LeftHand{f.title().replace('Little', 'Pinky')}{i}" for i in (1, 2, 3, 4)] for f in FINGERS],
    ),
    "Unreal": (
        "hand_l",
        [f"thumb_{i:02}_l" for i in (1, 2, 3)],
        [[f"{f.replace('little', 'pinky')}_{part}_l" for part in ("metacarpal", "01", "02", "03")] for f in FINGERS],
    ),
    "VRM": (
        "J_Bip_L_Hand",
        [f"J_Bip_L_Thumb{i}" for i in (1, 2, 3)],
        [[f"J_Bip_L_{f.title()}{i}" for i in (1, 2, 3)] for f in FINGERS],
    ),
}


def other_side(name):
    """The name of the right hand's bone."""
    return re.sub(r"Left|(?<![A-Za-z])[Ll](?![A-Za-z])", lambda side: {"Left": "Right", "L": "R", "l": "r"}[side[0]], name)


@pytest.mark.parametrize("naming", sorted(NAMES))
def test_bones_are_found_by_their_names(naming):
    wrist, thumb, fingers = NAMES[naming]
    rig = [bones.Bone("root"), bones.Bone(wrist, "root")]
    for chain in (thumb, *fingers):
        rig += [bones.Bone(name, parent) for name, parent in zip(chain, [wrist, *chain])]
    if naming != "WebXR":
        # The other hand, and bones that only move others.
        rig += [bones.Bone(other_side(bone.name), bone.parent and other_side(bone.parent)) for bone in rig[1:]]
        rig += [bones.Bone(f"{kind}-{chain[0].removeprefix('DEF-')}") for kind in ("ORG", "MCH") for chain in (thumb, *fingers)]
    found = bones.joint_bones(rig, "HANDEDNESS_LEFT")
    assert found[0] is None and found[1] == (wrist, "head")
    for digit, chain in enumerate((thumb, *fingers)):
        tip = kinematics.TIP_OF_DIGIT[digit]
        links = chain[1:] if digit and (len(chain) == 5 or "metacarpal" in chain[0].lower()) else chain
        assert [found[joint] for joint in (tip - 3, tip - 2, tip - 1)] == [(name, "head") for name in links[:3]]
        assert found[tip] == ((links[3], "head") if len(links) > 3 else (links[2], "tail"))
    with pytest.raises(connect.GraspError, match="wrist"):
        bones.joint_bones([bone for bone in rig if bone.name != wrist], "HANDEDNESS_LEFT")
    marked = [bone._replace(name="held") if bone.name == wrist else bone for bone in rig]
    with pytest.raises(connect.GraspError, match="wrist"):
        bones.joint_bones(marked, "HANDEDNESS_LEFT")


def test_a_bone_may_say_which_joint_it_is():
    wrist, thumb, fingers = NAMES["VRM"]
    rig = [bones.Bone("J_Bip_L_Paw", None, "wrist")]
    for chain in (thumb, *fingers):
        rig += [bones.Bone(name, parent) for name, parent in zip(chain, ["J_Bip_L_Paw", *chain])]
    assert bones.joint_bones(rig, "HANDEDNESS_LEFT")[1] == ("J_Bip_L_Paw", "head")


@pytest.fixture(scope="module")
def bpy_python():
    if not (ROOT / "target/foreign/blender/installed.txt").exists():
        pytest.skip("bpy, which is Blender for Python 3.11, is not installed")
    return PYTHON


def ended_well(arguments, **environment):
    """The output of a program, which has to exit with 0."""
    run = subprocess.run(
        arguments, cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True, timeout=240, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


def test_the_add_on_in_blender(address, bpy_python):
    files = [f"tests/foreign/blender/{name}.py" for name in ("headless", "headless_hands")]
    tests = [bpy_python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--show-capture=no", *files]
    print(ended_well(tests, GRASP_ADDRESS=address, PYTHONDONTWRITEBYTECODE="1"))


def test_the_readme_installs_the_extension_and_finds_a_grasp(address, bpy_python, tmp_path):
    (command,) = re.findall(r"^```sh\n(.*?)```", README, flags=re.MULTILINE | re.DOTALL)
    ended_well(["bash", "-c", command])
    archive = str(ROOT / "target/grasp-blender.zip")
    (console,) = re.findall(r"^```python\n(.*?)```", README, flags=re.MULTILINE | re.DOTALL)
    assert len(console.strip().splitlines()) <= 15
    script = f"""
import bpy
bpy.ops.preferences.addon_enable(module="bl_pkg")
bpy.ops.extensions.package_install_files(filepath={archive!r}, repo="user_default", enable_on_install=True)
bpy.ops.wm.read_homefile(use_empty=True)
{console.replace("[::1]:50051", address)}
assert bpy.context.window_manager.grasp_known[0].name == "from the side"
assert bpy.data.objects["Grasp receiver right"].animation_data.action
"""
    said = ended_well([bpy_python, "-c", script], BLENDER_USER_RESOURCES=str(tmp_path))
    assert re.search(r"^[A-Z][a-z ]+\w* 0\.\d+$", said, flags=re.MULTILINE), said


def test_blender_takes_the_manifest(bpy_python):
    ended_well([sys.executable, str(ADD_ON / "build.py"), "target/grasp-blender.zip"])
    (checker,) = PYTHON.parents[1].glob("lib/*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    ended_well([bpy_python, str(checker), "validate", "target/grasp-blender.zip"])


def test_every_file_that_the_readme_links_exists():
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", README):
        assert (ADD_ON / target).exists(), target
