"""A hand built from the 26 OpenXR joints and radii of a reply: its solids, joint angles and handedness.

Limits and lengths come from the rigs' descriptions (assets/hands/*.json). In their frames the fingers point along +y
and the palm faces +z; in those of OpenXR joints, -Z and -Y.
"""

import json
import pathlib

import numpy as np
from scipy.spatial.transform import Rotation

from solids import Capsules

ROOT = pathlib.Path(__file__).resolve().parents[2]
DIGITS = ["thumb", "index", "middle", "ring", "little"]
PHALANGES = ["first", "second", "third"]
PALM, WRIST = 0, 1
# The joints of each digit's three phalanges and its tip; a finger's metacarpal is the joint before them.
CHAINS = [[2, 3, 4, 5], [7, 8, 9, 10], [12, 13, 14, 15], [17, 18, 19, 20], [22, 23, 24, 25]]
METACARPALS = [6, 11, 16, 21]
NAMES = ["palm", "wrist"] + [
    f"{digit}-{bone}"
    for digit, bones in [
        ("thumb", ["metacarpal", "phalanx-proximal", "phalanx-distal", "tip"]),
        *(
            (finger, ["metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"])
            for finger in ["index-finger", "middle-finger", "ring-finger", "pinky-finger"]
        ),
    ]
    for bone in bones
]
# A half turn about (0, 1, -1) between the axes of a rig's frame and those of an OpenXR joint.
HALF_TURN = Rotation.from_quat([0.0, 0.5**0.5, -(0.5**0.5), 0.0])
# The forearm behind the wrist, in metres; its radius grows from the wrist's to this (ANSUR II: adults' forearms measure
# 26 to 31 cm around, so 41 to 49 mm).
FOREARM_LENGTH, FOREARM_RADIUS = 0.25, 0.042
# Range of motion of a wrist in degrees (AAOS).
FLEXION, EXTENSION, RADIAL, ULNAR = 80, 70, 20, 30


class Hand:
    """Joint poses of one hand, all in one frame."""

    def __init__(self, handedness, positions, orientations, radii, rig=None):
        self.handedness = handedness
        self.positions = np.array(positions, float)
        self.rotations = Rotation.from_quat(orientations)
        self.radii = np.array(radii, float)
        self.rig = rig

    @classmethod
    def from_joints(cls, handedness, joints, rig=None):
        """Reads the 26 joints of the API's JSON, or 25: the palm is then put halfway along the middle metacarpal."""
        poses = [joint["client_from_joint"] for joint in joints]
        positions = [pose["position"] for pose in poses]
        orientations = [pose["orientation"] for pose in poses]
        radii = [joint["radius"] for joint in joints]
        if len(joints) == 25:
            positions.insert(0, np.mean([positions[10], positions[11]], axis=0))
            orientations.insert(0, orientations[10])
            radii.insert(0, radii[10])
        return cls(handedness, positions, orientations, radii, rig)

    def moved(self, rotation, translation):
        """The hand after a rigid motion."""
        return Hand(
            self.handedness,
            rotation.apply(self.positions) + translation,
            (rotation * self.rotations).as_quat(),
            self.radii,
            self.rig,
        )

    def solids(self):
        """The tapered capsules of phalanges and palm, and a tag for each: its digit and phalanx, -1 for the palm."""
        ends, tags = [], []
        for digit, chain in enumerate(CHAINS):
            for phalanx in range(3):
                ends.append((chain[phalanx], chain[phalanx + 1]))
                tags.append((digit, phalanx))
        bones = list(zip(METACARPALS, [chain[0] for chain in CHAINS[1:]]))
        ends += bones
        # Flesh between the bones: across the knuckles, across the bases of the metacarpals, and to the wrist.
        ends += [(a[1], b[1]) for a, b in zip(bones, bones[1:])]
        ends += [(a[0], b[0]) for a, b in zip(bones, bones[1:])]
        ends += [(WRIST, bone[0]) for bone in bones] + [(WRIST, CHAINS[0][0])]
        tags += [(-1, -1)] * (len(ends) - len(tags))
        ends, tags = np.array(ends), np.array(tags)
        starts, stops = self.positions[ends[:, 0]], self.positions[ends[:, 1]].copy()
        # A tip lies on the skin, so the centre of the last ball is one radius behind it.
        for row, (digit, phalanx) in enumerate(tags):
            if phalanx == 2:
                axis = stops[row] - starts[row]
                length = np.linalg.norm(axis)
                stops[row] -= axis * min(1.0, self.radii[ends[row, 1]] / max(length, 1e-9))
        return Capsules(starts, stops, self.radii[ends[:, 0]], self.radii[ends[:, 1]]), tags

    def forearm(self, flexion=0.0, deviation=0.0):
        """The forearm for a wrist bent by these degrees: flexion, and deviation toward the little finger."""
        side = 1.0 if self.handedness == "right" else -1.0
        # Seen from the hand, flexion turns the elbow toward the palm (-Y), and ulnar deviation toward the little finger
        # (+X of a right hand).
        bend = Rotation.from_euler("xy", [flexion, side * deviation], degrees=True)
        elbow = self.positions[WRIST] + self.rotations[WRIST].apply(bend.apply([0, 0, FOREARM_LENGTH]))
        return Capsules([self.positions[WRIST]], [elbow], [self.radii[WRIST]], [FOREARM_RADIUS])

    def forearms(self):
        """Forearms over the wrist's range of motion, the straight one first."""
        angles = [(f, d) for f in range(-EXTENSION, FLEXION + 1, 15) for d in range(-RADIAL, ULNAR + 1, 10)]
        angles.sort(key=lambda pair: abs(pair[0]) + abs(pair[1]))
        return [self.forearm()] + [self.forearm(*pair) for pair in angles]

    def chirality(self):
        """The handedness implied by the joint positions.

        On a right hand, the vector from the wrist to the middle knuckle crossed with that from the index to the little
        knuckle points out of the palm, which is the palm joint's -Y.
        """
        across = self.positions[CHAINS[4][0]] - self.positions[CHAINS[1][0]]
        along = self.positions[CHAINS[2][0]] - self.positions[WRIST]
        palmar = self.rotations[PALM].apply([0, -1, 0])
        return "right" if np.dot(np.cross(along, across), palmar) > 0 else "left"

    def angles(self):
        """Joint angles, the largest twist, and the largest displacement.

        Angles are in degrees, a yaw and three pitches per digit. The twist, in degrees, is a rotation about an axis
        that the joint does not have. The displacement, in metres, is between a joint and where the rig's bone lengths
        put it, given the joints' orientations.
        """
        rig = description(self.rig, self.handedness)
        wrist = self.rotations[WRIST] * HALF_TURN
        angles, twist = np.zeros((5, 4)), 0.0
        displaced = 0.0
        for digit, chain in enumerate(CHAINS):
            entry = rig["digits"][DIGITS[digit]]
            base = wrist * Rotation.from_quat(entry["base_orientation_xyzw"])
            links = [self.rotations[joint] * HALF_TURN for joint in chain[:3]]
            turn = (base.inv() * links[0]).as_matrix()
            angles[digit, 0] = entry["yaw_sign"] * np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))
            angles[digit, 1] = np.degrees(np.arctan2(turn[2, 1], turn[2, 2]))
            twist = max(twist, abs(turn[2, 0]))
            for joint in (1, 2):
                turn = (links[joint - 1].inv() * links[joint]).as_matrix()
                angles[digit, joint + 1] = np.degrees(np.arctan2(turn[2, 1], turn[1, 1]))
                twist = max(twist, np.linalg.norm(turn[0] - [1, 0, 0]))
            root = self.positions[WRIST] + wrist.apply(entry["base_m"])
            displaced = max(displaced, np.linalg.norm(root - self.positions[chain[0]]))
            for i, length in enumerate(entry["lengths_m"]):
                end = self.positions[chain[i]] + links[i].apply([0, length, 0])
                displaced = max(displaced, np.linalg.norm(end - self.positions[chain[i + 1]]))
        return angles, np.degrees(np.arcsin(min(1.0, twist))), displaced

    def beyond_limits(self):
        """How far the worst joint is beyond its limits, in degrees; twists count too."""
        rig = description(self.rig, self.handedness)
        angles, twist, _ = self.angles()
        worst = twist
        for digit, entry in enumerate(rig["digits"][name] for name in DIGITS):
            limits = entry["limits_degrees"]
            for joint, name in enumerate(["base_yaw", "base_pitch", "second_pitch", "third_pitch"]):
                low, high = limits[name]
                worst = max(worst, low - angles[digit, joint], angles[digit, joint] - high)
        return worst


_descriptions = {}


def description(rig, handedness):
    """The description of a built-in rig."""
    key = f"{rig}_{handedness}"
    if key not in _descriptions:
        _descriptions[key] = json.loads((ROOT / "assets/hands" / f"{key}.json").read_text(encoding="utf-8"))
    return _descriptions[key]


def posed(rig, handedness, position, orientation, digits):
    """A rig's hand posed by joint angles in radians: yaw about z, then pitches about x."""
    entry = description(rig, handedness)
    wrist = Rotation.from_quat(orientation) * HALF_TURN
    position = np.asarray(position, float)
    positions, rotations = np.tile(position, (26, 1)), [wrist] * 26
    for digit, chain in enumerate(CHAINS):
        bones, angles = entry["digits"][DIGITS[digit]], digits[digit]
        third = angles.get("third_pitch")
        pitches = [
            angles["base_pitch"],
            angles["second_pitch"],
            angles["second_pitch"] * 2 / 3 if third is None else third,
        ]
        rotation = wrist * Rotation.from_quat(bones["base_orientation_xyzw"])
        rotation = rotation * Rotation.from_euler("z", bones["yaw_sign"] * angles["base_yaw"])
        joint_position = position + wrist.apply(bones["base_m"])
        for i in range(3):
            rotation = rotation * Rotation.from_euler("x", pitches[i])
            positions[chain[i]], rotations[chain[i]] = joint_position, rotation
            joint_position = joint_position + rotation.apply([0, bones["lengths_m"][i], 0])
        positions[chain[3]], rotations[chain[3]] = joint_position, rotation
    for finger, joint in enumerate(METACARPALS):
        positions[joint] = position + wrist.apply(entry["finger_metacarpals_m"][finger])
        along = wrist.inv().apply(positions[joint + 1] - positions[joint])
        rotations[joint] = wrist * Rotation.align_vectors([along / np.linalg.norm(along)], [[0.0, 1.0, 0.0]])[0]
    positions[PALM], rotations[PALM] = (positions[11] + positions[12]) / 2, rotations[11]
    radii = [entry["joint_radii_m"][name] for name in NAMES]
    return Hand(handedness, positions, [(rotation * HALF_TURN).as_quat() for rotation in rotations], radii, rig)
