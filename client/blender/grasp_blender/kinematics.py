"""Joints of a hand that is known by its angles, and the packed form in which a game sends grasps to its players."""

import math
import struct

from .axes import IDENTITY, about, composed, inverse, product, conjugate
from .messages import ANGLES, DIGITS, pose, pose_json

PALM, WRIST = 0, 1
# Joints of OpenXR, by the names of WebXR; "palm" is OpenXR's own.
JOINT_NAMES = (
    "palm",
    "wrist",
    *(f"thumb-{part}" for part in ("metacarpal", "phalanx-proximal", "phalanx-distal", "tip")),
    *(
        f"{finger}-finger-{part}"
        for finger in ("index", "middle", "ring", "pinky")
        for part in ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
    ),
)
FIRST_OF_DIGIT = (2, 6, 11, 16, 21)
TIP_OF_DIGIT = (5, 10, 15, 20, 25)
HANDEDNESSES = ("HANDEDNESS_LEFT", "HANDEDNESS_RIGHT")
_GRASP_CONVENTIONS = (
    "CONVENTION_UNSPECIFIED",
    "CONVENTION_OPENXR",
    "CONVENTION_UNITY",
    "CONVENTION_UNREAL",
    "CONVENTION_GODOT",
    "CONVENTION_UNITY_FLIP_X",
    "CONVENTION_UNREAL_XZY",
)


def angles_of(digit):
    """The four angles of DigitAngles, in radians."""
    yaw, base, second = (digit.get(name, 0.0) for name in ANGLES[:3])
    return yaw, base, second, digit.get("thirdPitch", second * 2 / 3)


def joints_of(rig, hand):
    """The 26 joints of a HandPose in OpenXR's axes, in its wrist's frame, from a HandRig: poses, None for missing digits.

    Pitch turns a joint about its -x. Yaw turns a finger's base about its +y on a left hand, about -y on a right one; a thumb's
    the other way.
    """
    side = next(side for side in rig["hands"] if side["handedness"] == hand["handedness"])
    size = hand.get("scale", 1.0)
    stretched = [pose(joint["pose"]) if joint.get("pose") else None for joint in side["stretchedJoints"]]
    stretched = [joint and (tuple(size * part for part in joint[0]), joint[1]) for joint in stretched]
    joints = list(stretched)
    limits = {limit["digit"]: limit for limit in side["limits"]}
    for index, name in enumerate(DIGITS):
        if f"DIGIT_{name.upper()}" not in limits or name not in hand:
            continue
        limit = limits[f"DIGIT_{name.upper()}"]
        # Angles of the stretched hand are as close to zero as limits allow.
        lowest, highest = angles_of(limit.get("min", {})), angles_of(limit.get("max", {}))
        at_rest = [min(max(0.0, low), high) for low, high in zip(lowest, highest)]
        angles = angles_of(hand[name])
        yaw_sign = (1 if side["handedness"] == "HANDEDNESS_LEFT" else -1) * (-1 if name == "thumb" else 1)

        def base_turn(angles):
            return product(about(1, yaw_sign * angles[0]), about(0, -angles[1]))

        first, tip = FIRST_OF_DIGIT[index] + (name != "thumb"), TIP_OF_DIGIT[index]
        turn = product(conjugate(base_turn(at_rest)), base_turn(angles))
        joints[first] = composed(stretched[first], ((0.0, 0.0, 0.0), turn))
        for joint in range(first, tip):
            link = composed(inverse(stretched[joint]), stretched[joint + 1])[0]
            bend = about(0, -angles[joint - first + 2]) if joint + 1 < tip else IDENTITY[1]
            joints[joint + 1] = composed(joints[joint], (link, bend))
    return joints


def unpacked(packed):
    """A packed grasp (version 1) as {"hand": HandPose, "contacts": names of digits and "palm", "type": number of a GraspType}.

    Raises ValueError if the bytes are none.
    """
    try:
        version, digits, contacts, kind, convention, scale, exponent = struct.unpack_from("<6Bb", packed)
        numbers = struct.unpack_from("<7h", packed, 7)
        if version != 1:
            raise ValueError(f"a packed grasp of version {version}")
        end = 22 + packed[21]
        rig = packed[22:end].decode("ascii")
        present = [name for index, name in enumerate(DIGITS) if digits >> (index + 1) & 1]
        if len(packed) != end + 6 * len(present):
            raise ValueError(f"{len(packed)} bytes, not {end + 6 * len(present)}")
        length = math.sqrt(sum(part * part for part in numbers[3:]))
        wrist = tuple(part * 2.0**exponent for part in numbers[:3]), tuple(part / length for part in numbers[3:])
        hand = {
            "rig": f"rigs/{rig}",
            "handedness": HANDEDNESSES[digits & 1],
            "scale": scale / 100,
            "objectFromWrist": pose_json(wrist),
            "convention": _GRASP_CONVENTIONS[convention],
        }
    except (struct.error, IndexError, UnicodeDecodeError, ZeroDivisionError) as error:
        raise ValueError(f"no packed grasp: {error}") from error
    for index, name in enumerate(present):
        bits = int.from_bytes(packed[end + 6 * index : end + 6 * index + 6], "little")
        values = [bits >> (12 * angle) & 0xFFF for angle in range(4)]
        hand[name] = dict(zip(ANGLES, ((value - 2048) * math.pi / 2048 for value in values)))
    touching = [name for index, name in enumerate((*DIGITS, "palm")) if contacts >> index & 1]
    return {"hand": hand, "contacts": touching, "type": kind}
