"""Joints of a hand among the bones of an armature, by the bones' names."""

import re
from typing import NamedTuple

from .connect import GraspError
from .kinematics import FIRST_OF_DIGIT, JOINT_NAMES, TIP_OF_DIGIT

_DIGITS = ({"thumb"}, {"index", "pointer"}, {"middle", "mid"}, {"ring"}, {"little", "pinky", "pinkie"})
_SIDES = {"HANDEDNESS_LEFT": {"left", "l"}, "HANDEDNESS_RIGHT": {"right", "r"}}
# Bones that move others, of Rigify and of rigs with controls.
_HELPERS = {"mch", "org", "ik", "fk", "ctrl", "control", "master", "pole", "target", "tweak", "vis", "drv"}
_METACARPALS = {"metacarpal", "meta", "palm", "carpal"}


class Bone(NamedTuple):
    """A bone: its name, its parent's name or None, and the joint that its user says it is (a WebXR name), or None."""

    name: str
    parent: str | None = None
    joint: str | None = None


def words(name):
    """The words of a bone's name: camel case, dots, dashes and numbers part them."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


def joint_bones(bones, handedness):
    """For each joint of OpenXR, (bone's name, "head" or "tail"), or None where no bone is: the palm, metacarpals of most rigs.

    Knows the names of WebXR, OpenXR, VRM, Unity, Unreal, Mixamo and Rigify, and any names with a digit, a side and an order.
    Raises GraspError if there is no wrist, or a digit with fewer bones than links.
    """
    by_name = {bone.name: bone for bone in bones}
    depth = {}

    def depth_of(bone):
        if bone.name not in depth:
            depth[bone.name] = depth_of(by_name[bone.parent]) + 1 if bone.parent in by_name else 0
        return depth[bone.name]

    spelled = {bone.name: words(bone.name) for bone in bones}
    sided = any(_SIDES["HANDEDNESS_LEFT"] & {*spell} or _SIDES["HANDEDNESS_RIGHT"] & {*spell} for spell in spelled.values())
    deforming = any("def" in spell for spell in spelled.values())

    def counts(bone):
        spell = set(spelled[bone.name])
        helper = bool(spell & _HELPERS) or (deforming and "def" not in spell)
        return not helper and (not sided or bool(spell & _SIDES[handedness]))

    candidates = sorted((bone for bone in bones if counts(bone)), key=depth_of)
    found = [None] * len(JOINT_NAMES)
    for digit, (first, tip) in enumerate(zip(FIRST_OF_DIGIT, TIP_OF_DIGIT)):
        chain = [bone for bone in candidates if _DIGITS[digit] & {*spelled[bone.name]}]
        if not chain:
            continue
        # The chain that begins nearest to the wrist, without side branches.
        line = [chain[0].name]
        line += [bone.name for bone in chain[1:] if _descends(bone, line[0], by_name)]
        has_metacarpal = first != FIRST_OF_DIGIT[0] and (len(line) > 4 or bool(_METACARPALS & {*spelled[line[0]]}))
        links = line[1:] if has_metacarpal else line
        if len(links) < 3:
            raise GraspError("invalid_argument", f"{line[0]} and the bones below it are {len(line)}: a digit has 3 or more")
        if has_metacarpal:
            found[first] = (line[0], "head")
        for place, name in enumerate(links[:3]):
            found[tip - 3 + place] = (name, "head")
        found[tip] = (links[3], "head") if len(links) > 3 else (links[2], "tail")
    hands = [bone for bone in candidates if {"hand", "wrist"} & {*spelled[bone.name]} and not _of_digit(spelled[bone.name])]
    if hands:
        found[1] = (hands[0].name, "head")
    for bone in bones:
        if bone.joint in JOINT_NAMES and (not sided or _SIDES[handedness] & {*spelled[bone.name]}):
            found[JOINT_NAMES.index(bone.joint)] = (bone.name, "head")
    if found[1] is None:
        raise GraspError("invalid_argument", f"No bone is the wrist of the {handedness[11:].lower()} hand: name it hand or wrist")
    if found[12] is None or sum(found[tip] is not None for tip in TIP_OF_DIGIT) < 3:
        raise GraspError("invalid_argument", f"Too few bones are named after digits of the {handedness[11:].lower()} hand")
    return found


def _descends(bone, ancestor, by_name):
    while bone.parent in by_name:
        if bone.parent == ancestor:
            return True
        bone = by_name[bone.parent]
    return False


def _of_digit(spell):
    return any(names & {*spell} for names in _DIGITS)
