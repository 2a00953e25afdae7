"""Tests of the judge: it finds nothing wrong with a constructed grasp, and each single fault that is put into it."""

import copy

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import hand as hands
import measures
import report
from hand import Hand
from solids import Mesh
from test_geometry import BOX_FACES, box

# A pinch of the adult hand: yaw and three pitches of each digit, in degrees.
PINCH = [[40, 8, 8, 25], [0, 50, 42, 22], [0, 45, 45, 30], [0, 45, 50, 30], [0, 45, 50, 30]]
MASS, FRICTION = 0.1, 0.5


def pinching_hand(angles, handedness="right"):
    digits = [
        dict(zip(["base_yaw", "base_pitch", "second_pitch", "third_pitch"], np.radians(digit))) for digit in angles
    ]
    return hands.posed("adult", handedness, [0.1, 1.2, -0.3], [0.1, -0.3, 0.2, 0.93], digits)


def touching_balls(hand):
    """The closest points of the last phalanges of thumb and index, and the direction from one to the other."""
    capsules, tags = hand.solids()
    pair = [int(np.flatnonzero((tags == (digit, 2)).all(axis=1))[0]) for digit in (0, 1)]
    thumb, index = capsules.subset([pair[0]]), capsules.subset([pair[1]])
    steps = np.linspace(0, 1, 401)
    ends = [c.at(steps[:, None])[0][:, 0] for c in (thumb, index)]
    radii = [c.at(steps[:, None])[1][:, 0] for c in (thumb, index)]
    gaps = np.linalg.norm(ends[0][:, None] - ends[1][None], axis=2) - radii[0][:, None] - radii[1][None]
    i, j = np.unravel_index(gaps.argmin(), gaps.shape)
    direction = (ends[1][j] - ends[0][i]) / np.linalg.norm(ends[1][j] - ends[0][i])
    return ends[0][i] + radii[0][i] * direction, ends[1][j] - radii[1][j] * direction, direction


def joints_of(hand):
    return [
        {"client_from_joint": {"position": p.tolist(), "orientation": q.tolist()}, "radius": float(r)}
        for p, q, r in zip(hand.positions, hand.rotations.as_quat(), hand.radii)
    ]


def good():
    """A block held between thumb and index by forces that carry it, with a forbidden block beyond its outer end."""
    hand = pinching_hand(PINCH)
    thumb, index, direction = touching_balls(hand)
    middle = (thumb + index) / 2
    outward = middle - hand.positions[hands.WRIST]
    outward -= outward @ direction * direction
    outward /= np.linalg.norm(outward)
    # Gravity is perpendicular to the line between the contacts, so friction alone carries the block.
    axes = np.stack([direction, outward, np.cross(direction, outward)])
    up = axes[2]
    thickness = np.linalg.norm(index - thumb) / 2
    vertices = np.concatenate(
        [box([thickness, 0.009, 0.009], middle, axes), box([0.004, 0.004, 0.004], middle + 0.04 * outward, axes)]
    )
    faces = BOX_FACES + [[i + 8 for i in face] for face in BOX_FACES]
    pressing = MASS * measures.GRAVITY / FRICTION
    rotation, translation = Rotation.from_quat([0.3, 0.1, -0.5, 0.8]), np.array([0.4, 0.2, -1.0])
    mesh = Mesh(rotation.inv().apply(vertices - translation), faces)
    scene = measures.Scene(
        mesh=mesh,
        mass=MASS,
        centre_of_mass=rotation.inv().apply(middle - translation),
        friction=FRICTION,
        reach=0.03,
        forbidden=np.arange(12, 24),
        rotation=rotation,
        translation=translation,
        up=up,
        giver=pinching_hand(PINCH).moved(Rotation.identity(), 0.5 * outward),
    )
    contacts = [
        {
            "client_position": point.tolist(),
            "client_normal": (-sign * direction).tolist(),
            "client_force": (sign * pressing * direction + MASS * measures.GRAVITY / 2 * up).tolist(),
            "digit": digit,
            "phalanx": "third",
        }
        for point, sign, digit in [(thumb, 1, "thumb"), (index, -1, "index")]
    ]
    grasp = {"rig": "adult", "handedness": "right", "joints": joints_of(hand), "contacts": contacts, "comfort": 0.0}
    return scene, grasp, direction


def judged(scene, grasp):
    return measures.judge(scene, grasp)


def faults(scene, grasp):
    """The names of the measures that are out of bounds."""
    row = judged(scene, grasp)
    wrong = {
        "penetration": row["penetration"] > 0.001,
        "cone": row["force_outside_cone"],
        "balance": row["imbalance"] > 0.02,
        "strength": row["largest_force"] > measures.STRONGEST,
        "stretched": row["stretched_idle"] > 0,
        "chirality": row["wrong_chirality"],
        "faces_away": row["faces_away"] > 0,
        "normal": row["normal_wrong"] > 0,
        "off_mesh": row["off_mesh"] > measures.OFF_MESH,
        "off_skin": row["off_skin"] > measures.OFF_SKIN,
        "giver": row["giver_touched"],
        "limits": row["limits_broken"],
        "self": row["self_collision"],
        "forbidden": row["forbidden_distance"] < measures.FORBIDDEN,
        "comfort": row["comfort_error"] > 1e-6,
    }
    return {name for name, bad in wrong.items() if bad}


def with_hand(grasp, hand):
    changed = copy.deepcopy(grasp)
    changed["joints"] = joints_of(hand)
    return changed


def bent(grasp, changes):
    """The grasp with some joint angles changed, in degrees."""
    angles = np.array(PINCH, float)
    for place, value in changes.items():
        angles[place] = value
    return with_hand(grasp, pinching_hand(angles))


class TestGoodGrasp:
    def test_a_good_grasp_has_no_fault(self):
        scene, grasp, _ = good()
        assert faults(scene, grasp) == set()
        row = judged(scene, grasp)
        assert row["penetration"] < 1e-4
        assert row["imbalance"] < 1e-6
        assert row["off_skin"] < 1e-4
        assert report.acceptable({**row, "found": True})

    def test_measures_do_not_depend_on_the_frame(self):
        scene, grasp, _ = good()
        before = judged(scene, grasp)
        turn, shift = Rotation.from_quat([0.5, -0.2, 0.4, 0.7]), np.array([3.0, -1.0, 2.0])
        moved = copy.deepcopy(grasp)
        moved["joints"] = joints_of(measures.hand_of_reply(grasp).moved(turn, shift))
        for contact in moved["contacts"]:
            contact["client_position"] = turn.apply(contact["client_position"]) + shift
            contact["client_normal"] = turn.apply(contact["client_normal"])
            contact["client_force"] = turn.apply(contact["client_force"])
        scene.rotation, scene.translation = turn * scene.rotation, turn.apply(scene.translation) + shift
        scene.up, scene.giver = turn.apply(scene.up), scene.giver.moved(turn, shift)
        after = judged(scene, moved)
        for name, value in before.items():
            if isinstance(value, float):
                assert after[name] == pytest.approx(value, abs=1e-5), name


@pytest.mark.parametrize("handedness", ["left", "right"])
def test_hands_and_forearms_are_oriented_as_in_openxr(handedness):
    # In OpenXR's frame the fingers point along -Z, and +Y is out of the back of the hand.
    straight = hands.posed("adult", handedness, [0, 0, 0], [0, 0, 0, 1], [dict.fromkeys(
        ["base_yaw", "base_pitch", "second_pitch"], 0.0)] * 5)  # fmt: skip
    fist = hands.posed("adult", handedness, [0, 0, 0], [0, 0, 0, 1], [dict(
        base_yaw=0.0, base_pitch=1.0, second_pitch=1.0)] * 5)  # fmt: skip
    assert straight.chirality() == fist.chirality() == handedness
    middle, little, thumb = (straight.positions[hands.CHAINS[d][0]] for d in (2, 4, 0))
    assert middle[2] < -0.05 and abs(middle[1]) < 0.01
    assert (thumb[0] < 0 < little[0]) if handedness == "right" else (little[0] < 0 < thumb[0])
    assert fist.positions[hands.CHAINS[2][3]][1] < -0.03
    # The elbow is behind the wrist. Flexion moves it to the palm's side, ulnar deviation to the little finger's.
    elbow = straight.forearm().ends[0]
    np.testing.assert_allclose(elbow, [0, 0, hands.FOREARM_LENGTH], atol=1e-12)
    assert straight.forearm(flexion=60).ends[0][1] < -0.2
    assert straight.forearm(deviation=25).ends[0][0] * little[0] > 0


class TestFaults:
    @pytest.mark.parametrize("millimetres", [5, -5])
    def test_measures_the_depth_of_a_sunk_hand(self, millimetres):
        scene, grasp, direction = good()
        sunk = measures.hand_of_reply(grasp).moved(Rotation.identity(), millimetres / 1000 * direction)
        assert {"penetration", "off_skin"} <= faults(scene, with_hand(grasp, sunk))
        depth = judged(scene, with_hand(grasp, sunk))["penetration"]
        assert depth == pytest.approx(0.005, abs=3e-4)

    def test_a_blade_through_a_finger_is_deep_in_its_flesh(self):
        # A thin sheet across the index finger: its volume contains no skin, but it is deep in the flesh.
        scene, grasp, direction = good()
        hand = measures.hand_of_reply(grasp)
        centre, radius = hand.positions[hands.CHAINS[1][1]], hand.radii[hands.CHAINS[1][1]]
        axis = hand.positions[hands.CHAINS[1][2]] - centre
        axis /= np.linalg.norm(axis)
        side = np.cross(axis, direction) / np.linalg.norm(np.cross(axis, direction))
        sheet = box([0.0001, 0.03, 0.03], centre + 0.01 * axis, np.stack([axis, side, np.cross(axis, side)]))
        scene.mesh = Mesh(scene.to_object(sheet), BOX_FACES)
        row = measures.penetration(scene.mesh, hand.moved(
            scene.rotation.inv(), -scene.rotation.inv().apply(scene.translation)))  # fmt: skip
        assert row["object_in_flesh"] > 0.9 * (radius - 0.001)
        assert row["skin_in_object"] < 0.001
        assert row["penetration"] == row["object_in_flesh"]

    def test_a_finger_inside_a_large_block_is_deep_in_the_object(self):
        scene, grasp, _ = good()
        hand = measures.hand_of_reply(grasp)
        tip = hand.positions[hands.CHAINS[4][3]]
        scene.mesh, scene.forbidden = Mesh(scene.to_object(box([0.03] * 3, tip)), BOX_FACES), np.arange(0)
        assert judged(scene, grasp)["skin_in_object"] > 0.02

    def test_finds_flipped_and_tilted_normals(self):
        scene, grasp, _ = good()
        grasp["contacts"][1]["client_normal"] = [-x for x in grasp["contacts"][1]["client_normal"]]
        assert "faces_away" in faults(scene, grasp)
        scene, grasp, direction = good()
        tilted = Rotation.from_rotvec(np.radians(40) * scene.up).apply(grasp["contacts"][0]["client_normal"])
        grasp["contacts"][0]["client_normal"] = tilted
        assert "normal" in faults(scene, grasp)
        assert "faces_away" not in faults(scene, grasp)

    @pytest.mark.parametrize("inside_out", [False, True])
    def test_accepts_normals_between_those_of_the_faces_at_an_edge(self, inside_out):
        faces = [face[::-1] for face in BOX_FACES] if inside_out else BOX_FACES
        mesh, edge, face = Mesh(box([1.0, 1.0, 1.0]), faces), [1.0, 1.0, 0.2], [1.0, 0.99, 0.2]
        x, y, z = np.eye(3)
        slanted = (x + y) / np.sqrt(2)
        for normal in (x, y, slanted, -slanted):
            assert measures.is_normal(mesh, edge, normal)
        for normal in ((x - y) / np.sqrt(2), (x + z) / np.sqrt(2), z):
            assert not measures.is_normal(mesh, edge, normal)
        assert not measures.is_normal(mesh, face, slanted)

    def test_accepts_all_normals_in_the_octant_of_a_corner(self):
        mesh, corner = Mesh(box([1.0, 1.0, 1.0]), BOX_FACES), [1.0, 1.0, 1.0]
        assert measures.is_normal(mesh, corner, np.ones(3) / np.sqrt(3))
        assert not measures.is_normal(mesh, corner, np.array([1.0, 1.0, -1.0]) / np.sqrt(3))

    def test_the_sides_of_a_blade_form_an_edge_only_where_they_meet(self):
        # 2 cm long and 2 mm thick at the back; 2 mm from the edge, the sides are 0.2 mm apart.
        corners = [[0, y, z] for y in (-0.02, 0.02) for z in (-0.001, 0.001)] + [[0.02, -0.02, 0], [0.02, 0.02, 0]]
        faces = [[1, 4, 5], [1, 5, 3], [0, 5, 4], [0, 2, 5], [0, 1, 3], [0, 3, 2], [0, 4, 1], [2, 3, 5]]
        mesh, onward = Mesh(np.array(corners), faces), np.array([1.0, 0.0, 0.0])
        assert measures.is_normal(mesh, [0.02, 0.003, 0.0], onward)
        assert not measures.is_normal(mesh, [0.018, 0.003, 0.0001], onward)

    def test_finds_a_mirrored_hand(self):
        scene, grasp, _ = good()
        hand = measures.hand_of_reply(grasp)
        quaternions = hand.rotations.as_quat() * [1, -1, -1, 1]
        mirrored = Hand("right", hand.positions * [-1, 1, 1], quaternions, hand.radii, hand.rig)
        assert "chirality" in faults(scene, with_hand(grasp, mirrored))
        # Labelled as the left hand that it is, it keeps its limits but is still not the requested hand.
        grasp["handedness"] = "left"
        found = faults(scene, with_hand(grasp, mirrored))
        assert "chirality" in found and "limits" not in found
        scene.asked_handedness = "left"
        assert "chirality" not in faults(scene, with_hand(grasp, mirrored))

    def test_finds_contacts_off_the_mesh_or_off_the_skin(self):
        scene, grasp, direction = good()
        grasp["contacts"][0]["client_position"] = grasp["contacts"][0]["client_position"] + 0.001 * direction
        assert "off_mesh" in faults(scene, grasp) and "off_skin" not in faults(scene, grasp)
        scene, grasp, direction = good()
        capsules, _ = measures.hand_of_reply(grasp).solids()
        sideways = np.cross(capsules.directions[5], direction)
        moved = grasp["contacts"][1]["client_position"] + 0.0085 * sideways / np.linalg.norm(sideways)
        grasp["contacts"][1]["client_position"] = moved
        assert "off_skin" in faults(scene, grasp) and "off_mesh" not in faults(scene, grasp)

    def test_finds_a_contact_assigned_to_another_digit(self):
        scene, grasp, _ = good()
        grasp["contacts"][1]["digit"] = "little"
        assert "off_skin" in faults(scene, grasp)

    @pytest.mark.parametrize(
        "changes", [{(4, 2): 110}, {(4, 1): -10}, {(3, 0): 24}, {(0, 3): 85}, {(2, 3): 95}], ids=str
    )
    def test_measures_how_far_a_joint_is_beyond_its_limit(self, changes):
        scene, grasp, _ = good()
        row = judged(scene, bent(grasp, changes))
        assert row["limits_broken"]
        limit = {110: 10, -10: 10, 24: 4, 85: 5, 95: 5}[next(iter(changes.values()))]
        assert row["beyond_limits"] == pytest.approx(limit, abs=1e-3)

    def test_finds_twisted_and_lengthened_bones(self):
        scene, grasp, _ = good()
        hand = measures.hand_of_reply(grasp)
        turned = hand.rotations.as_matrix()
        joint = hands.CHAINS[4][2]
        turned[joint] = turned[joint] @ Rotation.from_euler("y", 20, degrees=True).as_matrix()
        twisted = Hand("right", hand.positions, Rotation.from_matrix(turned).as_quat(), hand.radii, "adult")
        assert "limits" in faults(scene, with_hand(grasp, twisted))
        longer = hand.positions.copy()
        longer[hands.CHAINS[4][3]] += 0.01 * (longer[hands.CHAINS[4][3]] - longer[hands.WRIST])
        pulled = Hand("right", longer, hand.rotations.as_quat(), hand.radii, "adult")
        assert "limits" in faults(scene, with_hand(grasp, pulled))

    def test_finds_a_finger_through_another(self):
        scene, grasp, _ = good()
        assert "self" not in faults(scene, bent(grasp, {(4, 0): 10}))
        # First the little finger goes through the ring finger, then the index finger through the thumb.
        assert "self" in faults(scene, bent(grasp, {(3, 0): 15, (4, 0): -20}))
        assert "self" in faults(scene, bent(grasp, {(1, 1): 75}))

    def test_finds_a_fingertip_in_the_palm(self):
        scene, grasp, _ = good()
        assert "self" in faults(scene, bent(grasp, {(4, 1): 90, (4, 2): 110, (4, 3): 60}))

    def test_finds_a_giver_in_the_hand(self):
        scene, grasp, _ = good()
        scene.giver = measures.hand_of_reply(grasp).moved(Rotation.identity(), np.array([0.01, 0, 0]))
        assert "giver" in faults(scene, grasp)
        row = judged(scene, grasp)
        assert row["giver_hand"] < -0.005

    def test_finds_a_forearm_blocked_in_every_direction(self):
        scene, grasp, _ = good()
        wrist = measures.hand_of_reply(grasp).positions[hands.WRIST]
        giver = scene.giver
        # A giver's fist right at the wrist blocks every direction of the forearm.
        scene.giver = Hand("right", np.tile(wrist, (26, 1)) + np.linspace(-1e-3, 1e-3, 26)[:, None],
                           giver.rotations.as_quat(), giver.radii, "adult")  # fmt: skip
        assert judged(scene, grasp)["own_forearm"] < 0

    def test_finds_unbalanced_too_strong_slipping_and_pulling_forces(self):
        scene, grasp, direction = good()
        grasp["contacts"][0]["client_force"] = np.multiply(grasp["contacts"][0]["client_force"], 1.05)
        assert "balance" in faults(scene, grasp)
        # Pressing harder on both sides is fine until it is too strong; pressing less lets the block slip.
        for factor, expected in [(3, set()), (14, {"strength"}), (0.4, {"cone"})]:
            scene, grasp, direction = good()
            more = (factor - 1) * MASS * measures.GRAVITY / FRICTION * direction
            for contact, sign in zip(grasp["contacts"], (1, -1)):
                contact["client_force"] = np.add(contact["client_force"], sign * more)
            assert faults(scene, grasp) == expected
        # A contact cannot pull.
        scene, grasp, direction = good()
        for contact in grasp["contacts"]:
            contact["client_force"] = np.multiply(contact["client_force"], -1)
        assert {"cone", "balance"} <= faults(scene, grasp)

    def test_finds_the_torque_of_an_offset_centre_of_mass(self):
        scene, grasp, direction = good()
        scene.centre_of_mass = scene.centre_of_mass + scene.rotation.inv().apply(0.01 * direction)
        assert faults(scene, grasp) == {"balance"}

    def test_checks_the_torsions_of_the_reply(self):
        # A centre of mass off the line between the pads makes a torque about that line.
        scene, grasp, direction = good()
        outward = np.cross(scene.up, direction)
        scene.centre_of_mass = scene.centre_of_mass + scene.rotation.inv().apply(0.002 * outward)
        for contact in grasp["contacts"]:
            contact["client_force"] = np.add(contact["client_force"], contact["client_force"])
            contact["client_force"] -= MASS * measures.GRAVITY / 2 * scene.up
        # Without torsions in the reply the judge assumes the best; with torsions of the wrong sign nothing balances.
        assert faults(scene, grasp) == set()
        needed = MASS * measures.GRAVITY * 0.002 / 2
        inward = [-np.array(contact["client_normal"]) for contact in grasp["contacts"]]
        balanced = copy.deepcopy(grasp)
        for contact, axis in zip(balanced["contacts"], inward):
            contact["torsion"] = needed * np.sign(axis @ direction)
        flipped = copy.deepcopy(balanced)
        for contact in flipped["contacts"]:
            contact["torsion"] *= -1
        assert sorted("balance" in faults(scene, g) for g in (balanced, flipped)) == [False, True]
        # A torsion beyond the limit of friction.
        for contact in balanced["contacts"]:
            contact["torsion"] = 1.01 * FRICTION * 2 * MASS * measures.GRAVITY / FRICTION * measures.TORSION_RADIUS
        assert "cone" in faults(scene, balanced)

    def test_epsilon_of_two_pads_is_their_torsion(self):
        # Two pads are weakest about the line between them: friction times two thirds of the patch's radius over half
        # their distance, or over the shortest length that torques are divided by.
        scene, grasp, _ = good()
        thumb, finger = (np.array(contact["client_position"]) for contact in grasp["contacts"])
        length = np.clip(np.linalg.norm(thumb - finger) / 2, *measures.HAND_LENGTHS)
        assert judged(scene, grasp)["epsilon"] == pytest.approx(FRICTION * measures.TORSION_RADIUS / length, rel=0.02)
        grasp["contacts"].pop()
        assert judged(scene, grasp)["epsilon"] == 0.0

    def test_epsilon_of_a_cube_held_on_all_sides_is_that_of_an_octahedron(self):
        # With contacts far enough out, torques are easy and the hull of the forces decides. Frictionless pushes along
        # six axes make an octahedron, whose faces are 1 / sqrt 3 away.
        scene, _, _ = good()
        scene.friction = 1e-9
        length = measures.HAND_LENGTHS[1]
        contacts = []
        for axis in np.concatenate([np.eye(3), -np.eye(3)]):
            for around in np.concatenate([np.eye(3), -np.eye(3)]):
                if abs(axis @ around) < 0.5:
                    contacts.append({"normal": axis, "position": length * (axis + 9 * around)})
        assert measures.epsilon(scene, contacts)["epsilon"] == pytest.approx(3**-0.5, rel=0.02)

    def test_counts_stretched_idle_fingers(self):
        scene, grasp, _ = good()
        straight = {(3, 1): 5, (3, 2): 5, (3, 3): 5, (4, 1): 5, (4, 2): 5, (4, 3): 5}
        assert judged(scene, bent(grasp, straight))["stretched_idle"] == 2
        assert judged(scene, bent(grasp, {(3, 1): 5, (3, 2): 20}))["stretched_idle"] == 0

    def test_finds_a_touched_forbidden_surface(self):
        scene, grasp, _ = good()
        scene.forbidden = np.arange(12)
        assert faults(scene, grasp) == {"forbidden"}

    def test_computes_comfort_and_finds_a_wrong_one(self):
        scene, grasp, direction = good()
        grasp["comfort"] = 0.1
        assert faults(scene, grasp) == {"comfort"}
        grasp["contacts"][0]["client_force"] = np.multiply(grasp["contacts"][0]["client_force"], 3)
        assert judged(scene, grasp)["comfort"] == pytest.approx(2 * 0.25**2)


def test_targets_count_the_grasps_with_a_fault():
    scene, grasp, _ = good()
    row = {"found": True, "in_time": True, "round_trip_in_time": True, "round_trip_ms": 3.0, **judged(scene, grasp)}
    lines = {line.measure: line for line in report.targets([row])}
    assert all(line.met for line in lines.values() if line.met is not None)
    bad = {**row, "penetration": 0.004, "giver_hand": -0.001}
    lines = {line.measure: line for line in report.targets([row, bad, {"found": False, "in_time": False, "round_trip_in_time": False}])}
    assert not lines["penetration, worst"].met and not lines["giver's hand touched"].met
    assert lines["giver's hand touched"].figure.startswith("1 of 2")
    assert lines["wrong chirality"].met


class TestSheets:
    # A square of 20 cm in the plane z = 0.
    square = Mesh([[0, 0, 0], [0.2, 0, 0], [0.2, 0.2, 0], [0, 0.2, 0]], [[0, 1, 2], [0, 2, 3]])

    def test_a_rim_is_pressed_from_the_side_and_a_face_is_not(self):
        assert measures.is_normal(self.square, np.array([0.2, 0.07, 0.0]), np.array([1.0, 0.0, 0.0]))
        assert not measures.is_normal(self.square, np.array([0.2, 0.07, 0.0]), np.array([0.0, 1.0, 0.0]))
        assert not measures.is_normal(self.square, np.array([0.1, 0.07, 0.0]), np.array([1.0, 0.0, 0.0]))

    def test_a_bent_sheet_encloses_nothing_and_a_bowl_does(self):
        across = np.linspace(-1, 1, 21)
        x, y = (grid.ravel() for grid in np.meshgrid(across, across))
        faces = []
        for i in range(20):
            for j in range(20):
                a = 21 * i + j
                faces += [[a, a + 1, a + 22], [a, a + 22, a + 21]]
        bent = Mesh(np.column_stack([0.1 * x, 0.1 * y, 0.02 * x**2]), faces)
        inside = np.array([[0.0, 0.0, 0.004]])
        assert np.abs(bent.winding(inside)) > 0.4
        assert bent.is_sheet() and bent.depth(inside) == 0.0
        # The square as a disc, bulged to half a ball.
        radius, angle = np.maximum(np.abs(x), np.abs(y)), np.arctan2(y, x)
        polar = radius * np.pi / 2
        bowl = np.column_stack([np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), -np.cos(polar)])
        assert not Mesh(0.1 * bowl, faces).is_sheet()
        assert Mesh(0.1 * bowl, faces).depth([[0.0, 0.0, -0.06]]) > 0.03


def test_what_hangs_is_balanced_below_its_forces():
    scene, grasp, _ = good()
    up = np.array([0.0, 1.0, 0.0])
    weight = scene.mass * measures.GRAVITY
    place = scene.centre_of_mass + [0.02, 0.06, 0.0]
    lifting = [
        {"position": place + offset, "normal": -up, "force": weight / 2 * up, "digit": "index", "phalanx": "second",
         "torsion": None}
        for offset in ([0.0, 0.0, 0.01], [0.0, 0.0, -0.01])
    ]  # fmt: skip
    assert measures.forces(scene, lifting, up)["imbalance"] > 0.1
    assert measures.forces(scene, lifting, up, hangs=True)["imbalance"] < 1e-6
    # Too far to the side to swing there.
    for contact in lifting:
        contact["position"] = contact["position"] + [0.1, 0.0, 0.0]
    assert measures.forces(scene, lifting, up, hangs=True)["imbalance"] > 0.1
