"""What people notice about a grasp: boxes, sides and shares with known answers."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import choice
import compare
import report
from mesh import Mesh
from shapes import BOX_FACES, box
from test_stance import reply, scene_of, straight_hand

# A bar along x, 20 x 4 x 2 cm.
BAR = np.array([0.1, 0.02, 0.01])


def scene_with(mesh, rotation=Rotation.identity(), up=(0.0, 1.0, 0.0)):
    """Nobody holds the mesh, which is at the client's origin."""
    scene = scene_of(None, up, rotation, (0.0, 0.0, 0.0))
    scene.mesh = mesh
    return scene


def bar_scene(**more):
    return scene_with(Mesh(box(BAR), BOX_FACES), **more)


def contact(position, normal, force=1.0):
    """A contact that presses inward."""
    pressed = (-force * np.array(normal, float)).tolist()
    return {"client_position": position, "client_normal": normal, "client_force": pressed, "digit": "index"}


# Turns of an unturned hand, whose approach is halfway between -z and -y, that make it approach along an axis.
DOWN = Rotation.from_rotvec([-np.pi / 4, 0.0, 0.0])
ALONG_X = Rotation.from_rotvec([0.0, 0.0, np.pi / 2]) * DOWN
UPWARD = Rotation.from_rotvec([0.0, 0.0, np.pi]) * DOWN


def judged(scene, turn, contacts=()):
    return choice.judge(scene, reply(straight_hand("right", [0.0, 0.1, 0.0], turn), contacts=list(contacts)))


class TestBox:
    @pytest.mark.parametrize("seed", range(4))
    def test_box_of_a_turned_bar_is_the_bar(self, seed):
        turn = Rotation.random(rng=np.random.default_rng(seed))
        axes, sides, middle = choice.smallest_box(turn.apply(box(BAR, centre=(0.3, 0.0, -0.1))))
        assert np.allclose(sides, 2 * BAR) and np.allclose(middle, turn.apply([0.3, 0.0, -0.1]))
        assert np.allclose(np.abs(axes @ turn.as_matrix()), np.eye(3), atol=1e-4)

    def test_sheet_has_a_box(self):
        corners = np.array([[x, y, 0.0] for x in (0.0, 0.1) for y in (0.0, 0.05)])
        turn = Rotation.from_quat([0.3, 0.1, -0.5, 0.8])
        assert np.allclose(choice.smallest_box(turn.apply(corners))[1], [0.1, 0.05, 0.0], atol=1e-6)

    def test_ball_is_not_long(self):
        points = 0.05 * Rotation.random(200, rng=np.random.default_rng(1)).apply([0.0, 0.0, 1.0])
        sides = choice.smallest_box(points)[1]
        assert sides[0] < 1.2 * sides[2]


class TestSides:
    def test_hand_from_above_crosses_the_long_axis(self):
        row = judged(bar_scene(), DOWN)
        assert row["long"] and row["from_held"] == row["from_standing"] == "above"
        assert np.isclose(row["approach_to_axis"], 90)
        assert not choice.end_on([row])[0] and np.isclose(row["wrist_to_axis"], 90)

    def test_hand_along_the_axis_is_end_on_and_from_the_side(self):
        row = judged(bar_scene(), ALONG_X)
        assert row["from_held"] == "side" and np.isclose(row["approach_to_axis"], 0, atol=1e-4)
        assert choice.end_on([row])[0]

    def test_hand_from_beneath(self):
        assert judged(bar_scene(), UPWARD)["from_held"] == "beneath"

    def test_object_upside_down_is_taken_from_where_it_stands(self):
        over = Rotation.from_rotvec([np.pi, 0.0, 0.0])
        row = judged(bar_scene(rotation=over), DOWN)
        assert row["from_held"] == "above" and row["from_standing"] == "beneath"

    def test_cube_is_not_long(self):
        cube = scene_with(Mesh(box([0.02, 0.02, 0.02]), BOX_FACES))
        assert not judged(cube, DOWN)["long"]

    def test_turning_everything_changes_nothing(self):
        turn = Rotation.from_quat([0.3, 0.1, -0.5, 0.8])
        hand = straight_hand("right", [0.0, 0.1, 0.0], DOWN)
        row = choice.judge(bar_scene(), reply(hand))
        scene = bar_scene(rotation=turn, up=turn.apply([0.0, 1.0, 0.0]))
        moved = choice.judge(scene, reply(hand.moved(turn, np.zeros(3))))
        assert row == pytest.approx(moved, abs=1e-5)


class TestContacts:
    def test_pinch_across_the_smallest_side_halfway_to_the_end(self):
        pinch = [contact([0.05, 0.0, z], [0, 0, np.sign(z)]) for z in (0.01, -0.01)]
        row = judged(bar_scene(), DOWN, pinch)
        assert row["across_smallest"] and np.isclose(row["offset_along"], 0.5)

    def test_pinch_across_another_side(self):
        pinch = [contact([0.0, y, 0.0], [0, np.sign(y), 0]) for y in (0.02, -0.02)]
        row = judged(bar_scene(), DOWN, pinch)
        assert not row["across_smallest"] and np.isclose(row["offset_along"], 0)

    def test_sides_that_are_as_good_as_the_smallest_count(self):
        stick = scene_with(Mesh(box([0.1, 0.011, 0.01]), BOX_FACES))
        pinch = [contact([0.0, y, 0.0], [0, np.sign(y), 0]) for y in (0.011, -0.011)]
        assert judged(stick, DOWN, pinch)["across_smallest"]


class TestTable:
    def test_more_than_people_miss_the_target_only_if_nobody_holds(self):
        rows = [judged(bar_scene(), ALONG_X), {**judged(bar_scene(), ALONG_X), "held_out": True}]
        assert [met for *_, met in choice.lines(rows)] == [False, None, None, None]
        assert [met for *_, met in choice.lines([judged(bar_scene(), DOWN)])] == [True, None]

    def test_rows_of_two_hands_are_left_out(self):
        assert choice.lines([{"both": True}]) == []

    def test_table_has_chance_and_people(self):
        text = choice.table([judged(bar_scene(), DOWN)])
        assert "29 %" in text and "34 % (people, 53 objects)" in text and "94 % (Feix et al. 2014)" in text


class TestCompared:
    def test_difference_of_the_first_numbers(self, tmp_path):
        compare.save(tmp_path, [report.Target("end-on", "≤ 34 %", "49 % (49 of 100)", False)])
        text = compare.table([report.Target("end-on", "≤ 34 %", "30 % (30 of 100)", True)], tmp_path)
        assert "| end-on | 30 % (30 of 100) | 49 % (49 of 100) | -19 |" in text

    def test_figures_without_numbers_have_no_difference(self):
        assert compare.difference("none", "3 %") == ""
