"""Tests of the simulation on cases with a known outcome: pads that press hard enough, or not, and objects on a palm."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import hand as hands
import measures
import physics
from solids import Mesh
from test_geometry import BOX_FACES, box
from test_judge import FRICTION, MASS, PINCH, good, pinching_hand, touching_balls

WEIGHT = MASS * measures.GRAVITY


def held_block(pressing, friction=FRICTION):
    """The block between thumb and index, pressed with `pressing` newtons from each side, perpendicular to gravity."""
    hand = pinching_hand(PINCH)
    thumb, index, direction = touching_balls(hand)
    middle = (thumb + index) / 2
    outward = middle - hand.positions[hands.WRIST]
    outward -= outward @ direction * direction
    outward /= np.linalg.norm(outward)
    up = np.cross(direction, outward)
    corners = box([np.linalg.norm(index - thumb) / 2, 0.009, 0.009], middle, np.stack([direction, outward, up]))
    contacts = [
        {"position": point, "normal": -sign * direction, "force": sign * pressing * direction + WEIGHT / 2 * up,
         "digit": digit, "phalanx": "third", "torsion": None}
        for point, sign, digit in [(thumb, 1, "thumb"), (index, -1, "index")]
    ]  # fmt: skip
    return physics.Object([corners], MASS, middle, friction), hand, contacts, up, np.stack([direction, outward, up])


class TestPads:
    def test_enough_force_holds_against_gravity_and_pushes(self):
        outcomes = physics.simulate(*held_block(3 * WEIGHT / FRICTION))
        assert all(outcome.held for outcome in outcomes.values()), outcomes
        assert len(outcomes) == 7
        # Under gravity alone the block creeps by less than a millimetre.
        assert outcomes["gravity"].distance < 0.001

    def test_presses_with_the_forces_of_the_reply(self):
        obj, hand, contacts, up, _ = held_block(5.0)
        model = mujoco.MjModel.from_xml_string(physics.world(obj, [hand], -measures.GRAVITY * up))
        data = mujoco.MjData(model)
        for name, torque in physics.torques(hand, contacts).items():
            data.qfrc_applied[model.joint(name).dofadr[0]] = torque
        physics.hand_over(model, data)
        mujoco.mj_step(model, data, 500)
        forces = np.zeros((data.ncon, 6))
        for i, force in enumerate(forces):
            mujoco.mj_contactForce(model, data, i, force)
        # Thumb and index press equally, and together they bear the weight by friction.
        assert forces[:, 0].sum() == pytest.approx(2 * 5.0, rel=0.05)
        assert np.linalg.norm(forces[:, 1:3], axis=1).sum() == pytest.approx(WEIGHT, rel=0.1)

    @pytest.mark.parametrize("depth", [0.0005, 0.0015])
    def test_overlap_of_a_pad_adds_nothing_to_its_force(self, depth):
        obj, hand, contacts, up, axes = held_block(5.0)
        obj.pieces[0] = obj.pieces[0] + depth * (obj.pieces[0] - obj.centre_of_mass) @ np.outer(axes[0], axes[0]) / (
            np.abs((obj.pieces[0] - obj.centre_of_mass) @ axes[0]).max()
        )
        model = mujoco.MjModel.from_xml_string(physics.world(obj, [hand], -measures.GRAVITY * up))
        data = mujoco.MjData(model)
        for name, torque in physics.torques(hand, contacts).items():
            data.qfrc_applied[model.joint(name).dofadr[0]] = torque
        physics.hand_over(model, data)
        assert not data.eq_active.any()
        forces = np.zeros((data.ncon, 6))
        for i, force in enumerate(forces):
            mujoco.mj_contactForce(model, data, i, force)
        assert forces[:, 0].sum() == pytest.approx(2 * 5.0, rel=0.15)

    # Each pad has to bear half the weight by friction, so half of weight / friction would be just enough.
    @pytest.mark.parametrize(("force", "friction"), [(0.2 * WEIGHT / FRICTION, FRICTION), (WEIGHT / FRICTION, 0.1)])
    def test_too_little_force_or_friction_drops_the_object(self, force, friction):
        outcomes = physics.simulate(*held_block(force, friction))
        assert not outcomes["gravity"].held
        assert len(outcomes) == 1

    def test_a_push_along_gravity_dislodges_a_weakly_held_object(self):
        # The grip bears the weight with little in reserve, and a push along gravity doubles the load.
        outcomes = physics.simulate(*held_block(0.7 * WEIGHT / FRICTION), pushes=["-z", "+z"])
        assert outcomes["gravity"].held and outcomes["+z"].held
        assert not outcomes["-z"].held

    def test_verdicts_do_not_depend_on_the_frame(self):
        obj, hand, contacts, up, axes = held_block(0.7 * WEIGHT / FRICTION)
        before = physics.simulate(obj, hand, contacts, up, axes, ["-z"])
        turn, shift = Rotation.from_quat([0.5, -0.2, 0.4, 0.7]), np.array([0.3, -0.1, 0.2])
        other = physics.Object(
            [turn.apply(obj.pieces[0]) + shift], MASS, turn.apply(obj.centre_of_mass) + shift, FRICTION
        )
        after = physics.simulate(
            other, *moved(hand, contacts, turn, shift), turn.apply(up), turn.apply(axes), ["-z"]
        )
        # How it falls once it slips depends on rounding; whether it slips does not.
        assert [(name, o.held) for name, o in before.items()] == [(name, o.held) for name, o in after.items()]
        assert after["gravity"].distance == pytest.approx(before["gravity"].distance, abs=5e-4)


def test_what_hangs_may_swing_until_its_centre_of_mass_is_below():
    obj, hand, contacts, up, axes = held_block(1.3 * WEIGHT / FRICTION)
    pinched = obj.centre_of_mass
    obj.centre_of_mass = pinched - 0.02 * up + 0.016 * axes[1]
    assert physics.simulate(obj, hand, contacts, up, axes, [])["gravity"].fate is physics.Fate.TURNED
    obj.hangs_by = pinched
    swung = physics.simulate(obj, hand, contacts, up, axes, [])["gravity"]
    assert swung.held and swung.angle > physics.LOST_ANGLE, swung


def moved(hand, contacts, turn, shift):
    """A hand and its contacts after a rigid motion."""
    result = [
        {**c, "position": turn.apply(c["position"]) + shift, **{k: turn.apply(c[k]) for k in ("normal", "force")}}
        for c in contacts
    ]
    return hand.moved(turn, shift), result


def test_two_hands_hold_what_is_too_heavy_for_one():
    obj, hand, contacts, up, axes = held_block(0.7 * WEIGHT / FRICTION)
    obj.mass *= 2
    alone = physics.simulate(obj, hand, contacts, up, axes, [])
    assert not alone["gravity"].held
    turn = Rotation.from_rotvec(np.pi * up)
    other = moved(hand, contacts, turn, obj.centre_of_mass - turn.apply(obj.centre_of_mass))
    both = physics.simulate(obj, hand, contacts, up, axes, [], other)
    assert both["gravity"].held, both


def ball(centre, radius):
    """Points on a ball, along a spiral."""
    i = np.arange(400) + 0.5
    height, around = 1 - 2 * i / len(i), np.pi * (1 + 5**0.5) * i
    across = np.sqrt(1 - height**2)
    return centre + radius * np.stack([across * np.cos(around), height, across * np.sin(around)], axis=1)


def cupped_palm():
    """A hand at the origin with its palm up and its fingers slightly bent, and the direction of up."""
    digits = [dict(base_yaw=0.3, base_pitch=0.2, second_pitch=0.2)]
    digits += [dict(base_yaw=0.0, base_pitch=0.5, second_pitch=0.6)] * 4
    hand = hands.posed("adult", "right", [0, 0, 0], [0, 0, 0, 1], digits)
    return hand, np.array([0.0, -1.0, 0.0])


def resting_ball(depth=0.0, radius=0.03):
    """A ball resting on the palm, sunk in by `depth` metres."""
    hand, up = cupped_palm()
    capsules, _ = hand.solids()
    # Search a grid for the lowest place where the ball can rest in the hollow of the hand.
    x, z = np.meshgrid(np.linspace(-0.03, 0.03, 41), np.linspace(-0.13, -0.03, 61), indexing="ij")
    heights = np.full(x.shape, -0.1)
    low, high = np.full(x.shape, 0.0), np.full(x.shape, 0.15)
    for _ in range(30):
        heights = (low + high) / 2
        centres = np.stack([x, -heights, z], axis=2).reshape(-1, 3)
        clear = (capsules.distances(centres).min(axis=1) - radius >= 0).reshape(x.shape)
        low, high = np.where(clear, low, heights), np.where(clear, heights, high)
    i, j = np.unravel_index(heights[1:-1, 1:-1].argmin(), (39, 59))
    centre = np.array([x[i + 1, j + 1], -heights[i + 1, j + 1] + depth, z[i + 1, j + 1]])
    return physics.Object([ball(centre, radius)], MASS, centre, FRICTION), hand, up


class TestPalm:
    def test_a_ball_rests_on_the_palm_until_pushes_roll_it_off(self):
        obj, hand, up = resting_ball()
        outcomes = physics.simulate(obj, hand, [], up)
        assert outcomes["gravity"].distance < 0.01
        # Up is -y. The thumb stops a push to -x, and a push down changes nothing; all others move the ball off.
        assert {name for name, outcome in outcomes.items() if outcome.held} == {"gravity", "-x", "+y"}

    def test_an_overlap_of_two_millimetres_does_not_eject_the_ball(self):
        obj, hand, up = resting_ball(depth=0.002)
        outcome = physics.simulate(obj, hand, [], up, pushes=[])["gravity"]
        assert outcome.distance < 0.01


def test_an_object_without_a_hand_falls():
    obj, _, contacts, up, axes = held_block(10)
    outcomes = physics.simulate(obj, None, contacts, up, axes)
    assert list(outcomes) == ["gravity"]
    assert outcomes["gravity"].fate is physics.Fate.SLIPPED


class TestTorques:
    def test_torques_do_the_virtual_work_of_the_forces(self):
        # When a joint turns, torque times angle is force times the contact's displacement, here by finite differences.
        angles = np.array(PINCH, float)
        hand = pinching_hand(angles)
        random = np.random.default_rng(3)
        for digit in range(5):
            for phalanx in range(3):
                joint = hands.CHAINS[digit][phalanx]
                local = random.normal(size=3) * 0.01
                force = random.normal(size=3)
                contact = {
                    "position": hand.positions[joint] + hand.rotations[joint].apply(local), "force": force,
                    "normal": np.array([0.0, 0.0, 1.0]), "torsion": None,
                    "digit": hands.DIGITS[digit], "phalanx": hands.PHALANGES[phalanx],
                }  # fmt: skip
                found = physics.torques(hand, [contact])
                for turned in range(3):
                    bent = angles.copy()
                    bent[digit, turned + 1] += np.degrees(1e-6)
                    after = pinching_hand(bent)
                    way = after.positions[joint] + after.rotations[joint].apply(local) - contact["position"]
                    expected = force @ way / 1e-6
                    name = f"0 {hands.DIGITS[digit]} {hands.PHALANGES[turned]}"
                    assert found[name] == pytest.approx(expected, abs=1e-5)
                others = [v for name, v in found.items() if not name.startswith(f"0 {hands.DIGITS[digit]}")]
                assert not any(others)

    def test_contacts_of_the_palm_exert_no_torque(self):
        scene, grasp, _ = good()
        grasp["contacts"] = [{**grasp["contacts"][0], "digit": None, "phalanx": None}]
        hand, contacts = measures.in_object_frame(scene, grasp)
        assert not any(physics.torques(hand, contacts).values())


class TestConvex:
    def test_inertia_of_a_box_in_one_and_in_two_pieces(self):
        half = np.array([0.02, 0.05, 0.01])
        whole = [box(half, (1, 2, 3))]
        halves = [box(half * [1, 0.5, 1], (1, 2 + side * 0.025, 3)) for side in (-1, 1)]
        x, y, z = (2 * half) ** 2 / 12
        for parts in (whole, halves):
            np.testing.assert_allclose(physics.unit_inertia(parts), np.diag([y + z, x + z, x + y]), atol=1e-12)

    def test_pieces_follow_the_surface(self, tmp_path, monkeypatch):
        monkeypatch.setattr(physics, "FOLDER", tmp_path)
        # A closed L-shaped prism, whose hollow a single convex piece would fill, and a box that overlaps its end.
        outline = 0.01 * np.array([[0, 0], [6, 0], [6, 2], [2, 2], [2, 5], [0, 5]])
        prism = np.concatenate([np.column_stack([outline, np.full(6, z)]) for z in (-0.01, 0.01)])
        caps = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
        faces = [face[::-1] for face in caps] + [[i + 6 for i in face] for face in caps]
        for i in range(6):
            j = (i + 1) % 6
            faces += [[i, j, j + 6], [i, j + 6, i + 6]]
        mesh = Mesh(
            np.concatenate([prism, box([0.02, 0.02, 0.02], (0.07, 0.01, 0))]),
            faces + [[i + 12 for i in face] for face in BOX_FACES],
        )
        parts = physics.pieces(mesh)
        points = np.random.default_rng(4).uniform(mesh.low - 0.01, mesh.high + 0.01, (4000, 3))
        inside = np.zeros(len(points), bool)
        for corners in parts:
            equations = ConvexHull(corners).equations
            inside |= (points @ equations[:, :3].T + equations[:, 3]).max(axis=1) < 0
        distance = mesh.signed_distance(points)
        clear = np.abs(distance) > 0.0015
        np.testing.assert_array_equal(inside[clear], distance[clear] < 0)
        # The second call reads the cached file.
        file = next(tmp_path.glob("*.npz"))
        np.savez_compressed(file, parts[0] + 1.0)
        np.testing.assert_array_equal(physics.pieces(mesh)[0], parts[0] + 1.0)
