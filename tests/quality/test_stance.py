"""Where people stand: closed-form cases, mirrored ones, and scenes turned as a whole."""

import matplotlib.image
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import choice
import mannequin
import hand as hands
import measures
import relations
import report
import stance
from hand import Hand, WRIST
from solids import Mesh
from test_geometry import box, BOX_FACES

UP = np.array([0.0, 1.0, 0.0])
# A half turn about the vertical: a hand that points along -z then points along +z.
ABOUT = Rotation.from_rotvec([0.0, np.pi, 0.0])
FLAT = [{"base_yaw": 0.0, "base_pitch": 0.0, "second_pitch": 0.0}] * 5


def straight_hand(handedness, position, turn=Rotation.identity()):
    """A stretched hand whose wrist is at a position; unturned, its fingers point along -z and its palm down."""
    return hands.posed("adult", handedness, position, turn.as_quat(), FLAT)


def joints_of(hand):
    """The joints as in a reply."""
    return [
        {"client_from_joint": {"position": p.tolist(), "orientation": q.tolist()}, "radius": float(r)}
        for p, q, r in zip(hand.positions, hand.rotations.as_quat(), hand.radii)
    ]


def scene_of(giver, up=UP, rotation=Rotation.identity(), translation=(0.0, 1.2, -0.12), handedness="right"):
    """A small block, by default between the hands."""
    return measures.Scene(
        mesh=Mesh(box([0.01, 0.01, 0.03]), BOX_FACES),
        mass=0.1,
        centre_of_mass=np.zeros(3),
        friction=0.5,
        reach=0.03,
        forbidden=np.arange(0),
        rotation=rotation,
        translation=np.array(translation),
        up=np.array(up),
        giver=giver,
        asked_handedness=handedness,
    )


def reply(hand, **more):
    """A reply with this hand and no contacts."""
    grasp = {"rig": "adult", "handedness": hand.handedness, "joints": joints_of(hand), "contacts": []}
    return {**grasp, **more}


# The giver's forearm is horizontal; a receiver opposite with a left hand has the shoulder at the same x.
GIVER = straight_hand("right", [0.0, 1.2, 0.0])


def opposite(handedness="left", x=0.0, turn=ABOUT):
    return straight_hand(handedness, [x, 1.2, -0.24], turn)


def mirrored(hand):
    """The mirror image in the plane x = 0: a hand of the other side."""
    flip = np.diag([-1.0, 1.0, 1.0])
    turns = Rotation.from_matrix(flip @ hand.rotations.as_matrix() @ flip)
    other = "left" if hand.handedness == "right" else "right"
    return Hand(other, hand.positions @ flip, turns.as_quat(), hand.radii, hand.rig)


class TestGiver:
    def test_elbow_is_behind_the_wrist_and_the_shoulder_above_the_elbow(self):
        bodies = stance.behind(GIVER, UP)
        assert np.allclose(bodies.shoulders[0], [0.0, 1.2 + stance.UPPER_ARM, stance.FOREARM])
        assert np.allclose(bodies.forward, [0.0, 0.0, -1.0])
        assert np.allclose(bodies.outward, [1.0, 0.0, 0.0])

    def test_body_of_a_left_hand_is_on_its_right(self):
        bodies = stance.behind(mirrored(GIVER), UP)
        assert np.allclose(bodies.middles()[0], [stance.HALF_SHOULDERS, 1.5, stance.FOREARM])

    def test_every_arm_has_its_lengths_and_bends_no_farther_than_elbows_do(self):
        for turn in Rotation.random(40, rng=np.random.default_rng(3)):
            hand = straight_hand("right", [0.0, 1.2, 0.0], turn)
            elbow = hand.positions[WRIST] + stance.FOREARM * stance.forearm_direction(hand)
            upper = stance.behind(hand, UP).shoulders - elbow
            assert np.allclose(np.linalg.norm(upper, axis=1), stance.UPPER_ARM)
            bend = 180 - stance.angle(stance.unit(upper), -stance.forearm_direction(hand))
            assert (upper @ UP > 0).all() and (bend <= stance.ELBOW_FLEXION + 1e-6).all()

    def test_upright_forearm_tells_nothing_about_the_direction(self):
        raised = straight_hand("right", [0.0, 1.2, 0.0], Rotation.from_rotvec([np.pi / 2, 0.0, 0.0]))
        forward = stance.behind(raised, UP).forward
        assert np.allclose(forward @ UP, 0) and np.ptp(forward[:, 0]) > 1.7 and np.ptp(forward[:, 2]) > 1.7


class TestReceivers:
    def test_they_face_the_giver_at_the_distances_and_heights(self):
        bodies = stance.receivers(GIVER, UP, "right")
        offsets = bodies.middles()[:, None] - stance.behind(GIVER, UP).middles()
        heights = offsets @ UP
        flat = offsets - heights[..., None] * UP
        distances = np.linalg.norm(flat, axis=2)
        facing = np.isclose(np.einsum("bi,bgi->bg", bodies.forward, -flat), distances)
        plausible = facing & (np.abs(heights) <= 0.15 + 1e-9) & (distances <= 1.2 + 1e-9) & (distances >= 0.6 - 1e-9)
        assert plausible.any(axis=1).all()
        assert np.allclose(bodies.forward @ UP, 0)

    def test_nobody_stands_in_the_givers_hand(self):
        bodies = stance.receivers(GIVER, UP, "right")
        gaps = np.einsum("bi,bi->b", bodies.middles() - GIVER.positions[WRIST], -bodies.forward)
        assert gaps.min() >= stance.CLOSEST - 1e-9

    def test_elbows_keep_the_lengths_of_both_bones_and_hang(self):
        wrist = np.array([0.0, 1.2, -0.24])
        bodies = stance.receivers(GIVER, UP, "right")
        points, owners = stance.elbows(wrist, bodies, UP)
        assert len(points) > 100
        assert np.allclose(np.linalg.norm(points - wrist, axis=1), stance.FOREARM)
        assert np.allclose(np.linalg.norm(points - bodies.shoulders[owners], axis=1), stance.UPPER_ARM)
        assert ((points - bodies.shoulders[owners]) @ UP <= 1e-6).all()

    def test_nobody_reaches_a_wrist_that_is_far_away(self):
        points, owners = stance.elbows(np.array([0.0, -1.0, 0.0]), stance.receivers(GIVER, UP, "right"), UP)
        assert len(points) == len(owners) == 0


class TestWrist:
    @pytest.mark.parametrize("handedness", ["left", "right"])
    @pytest.mark.parametrize("bend", [(0, 0), (60, 10), (-50, -15), (30, 25)])
    def test_bend_is_that_of_the_forearm(self, handedness, bend):
        hand = straight_hand(handedness, [0.1, 1.0, 0.2], Rotation.from_quat([0.3, 0.1, -0.5, 0.8]))
        forearm = hand.forearm(*bend)
        flexion, deviation = stance.wrist_bend(hand, forearm.directions)
        assert np.allclose([flexion[0], deviation[0]], bend)

    @pytest.mark.parametrize("bend, allowed", [((79, 0), True), ((81, 0), False), ((-69, 0), True), ((-71, 0), False)])
    def test_flexion_is_limited(self, bend, allowed):
        hand = straight_hand("right", [0.0, 0.0, 0.0])
        assert stance.wrist_allows(hand, hand.forearm(*bend).directions)[0] == allowed

    @pytest.mark.parametrize("deviation, allowed", [(29, True), (31, False), (-19, True), (-21, False)])
    @pytest.mark.parametrize("handedness", ["left", "right"])
    def test_deviation_is_limited(self, handedness, deviation, allowed):
        hand = straight_hand(handedness, [0.0, 0.0, 0.0])
        assert stance.wrist_allows(hand, hand.forearm(0, deviation).directions)[0] == allowed


class TestGrasps:
    def test_hand_straight_opposite_fits(self):
        row = stance.judge(scene_of(GIVER), reply(opposite()))
        assert row["receiver_angle"] < 10 and row["elbow_reachable"] and row["stance_fits"] and row["own_side"]
        assert np.isclose(row["giver_angle"], 180)

    def test_hand_from_the_givers_side_does_not(self):
        row = stance.judge(scene_of(GIVER), reply(straight_hand("right", [0.1, 1.2, 0.0])))
        assert row["receiver_angle"] > stance.NEAR_RECEIVER and not row["stance_fits"] and not row["own_side"]
        assert np.isclose(row["giver_angle"], 0)

    def test_hand_from_overhead_is_no_receivers(self):
        down = Rotation.from_rotvec([-np.pi / 2, 0.0, 0.0])
        row = stance.judge(scene_of(GIVER), reply(straight_hand("right", [0.0, 1.35, -0.15], down)))
        assert row["receiver_angle"] > 45
        assert np.isclose(row["giver_angle"], 90)

    def test_hand_below_the_reach_of_everybody_has_no_elbow(self):
        row = stance.judge(scene_of(GIVER), reply(straight_hand("left", [0.0, 0.4, -0.24], ABOUT)))
        assert not row["elbow_reachable"] and not row["stance_fits"]

    def test_wrist_bent_too_far_has_no_elbow(self):
        # The back of the hand faces the receiver and the fingers point up: the forearm hangs from the hand.
        up = Rotation.from_rotvec([np.pi / 2, 0.0, 0.0])
        bodies = stance.Bodies(np.array([[0.0, 1.3, -0.7]]), np.array([[0.0, 0.0, 1.0]]), np.array([[-1.0, 0.0, 0.0]]))
        hand = straight_hand("right", [0.0, 1.2, -0.24], up * Rotation.from_rotvec([0.0, 0.0, np.pi / 2]))
        found = stance.nearest(hand, bodies, UP)
        assert not found.reachable

    def test_nobody_holding_has_no_receiver(self):
        assert stance.judge(scene_of(None), reply(opposite())) == {}
        assert stance.fits(scene_of(None), reply(opposite()))

    @pytest.mark.parametrize("x", [-0.15, 0.0, 0.2])
    def test_mirror_images_are_judged_alike(self, x):
        turn = Rotation.from_rotvec([0.0, 2.5, 0.0])
        receiver = opposite("right", x, turn)
        row = stance.judge(scene_of(GIVER), reply(receiver))
        image = stance.judge(scene_of(mirrored(GIVER)), reply(mirrored(receiver)))
        assert row == pytest.approx(image, abs=1e-5)

    @pytest.mark.parametrize("quaternion", [[0.3, 0.1, -0.5, 0.8], [0.7, -0.2, 0.1, 0.4]])
    def test_turning_everything_changes_nothing(self, quaternion):
        turn, shift = Rotation.from_quat(quaternion), np.array([0.4, -2.0, 1.0])
        receiver = opposite("right", 0.1, Rotation.from_rotvec([0.2, 2.5, 0.1]))
        row = stance.judge(scene_of(GIVER), reply(receiver))
        scene = scene_of(GIVER.moved(turn, shift), turn.apply(UP), turn, turn.apply([0.0, 1.2, -0.12]) + shift)
        assert row == pytest.approx(stance.judge(scene, reply(receiver.moved(turn, shift))), abs=1e-5)


class TestArmOfReply:
    hand = opposite()
    # The elbow is straight behind the wrist, the shoulder above it.
    elbow = np.array([0.0, 1.2, -0.24 - stance.FOREARM])
    shoulder = np.array([0.0, 1.2 + stance.UPPER_ARM, -0.24 - stance.FOREARM])

    def judged(self, shoulder, elbow, giver=GIVER):
        arm = {"client_shoulder": list(shoulder), "client_elbow": list(elbow)}
        return stance.judge(scene_of(giver), reply(self.hand, arm=arm))

    def test_good_arm(self):
        row = self.judged(self.shoulder, self.elbow)
        assert row["arm_lengths_right"] and row["arm_joints_right"] and row["arm_clearance"] > 0

    def test_arm_without_a_giver(self):
        row = self.judged(self.shoulder, self.elbow, giver=None)
        assert row["arm_lengths_right"] and "receiver_angle" not in row

    def test_long_upper_arm(self):
        assert not self.judged(self.shoulder + [0.0, 0.2, 0.0], self.elbow)["arm_lengths_right"]

    def test_elbow_in_front_of_the_hand(self):
        row = self.judged(self.shoulder, [0.0, 1.2, -0.24 + stance.FOREARM])
        assert not row["arm_joints_right"] and row["arm_clearance"] < 0

    def test_elbow_bent_too_far(self):
        assert not self.judged(self.hand.positions[WRIST] + [0.0, 0.05, 0.0], self.elbow)["arm_joints_right"]


class TestTable:
    row = {"receiver_angle": 20.0, "giver_angle": 120.0, "elbow_reachable": True, "stance_fits": True, "own_side": True}
    wrong = {**row, "receiver_angle": 100.0, "giver_angle": 30.0, "stance_fits": False}

    def test_grasps_that_fit_meet_the_targets(self):
        assert {met for *_, met in stance.lines([self.row])} == {True, None}

    def test_grasps_that_do_not_fit_miss_them(self):
        assert {met for *_, met in stance.lines([self.wrong])} == {False, None}

    def test_holdouts_without_any_fitting_grasp_do_not_count(self):
        hopeless = {**self.wrong, "stance_possible": False}
        assert stance.lines([self.row, hopeless])[0][2] == "100 % (1 of 1; 1 more have none)"
        possible = {**self.wrong, "stance_possible": True}
        assert stance.lines([self.row, possible])[0][2] == "50 % (1 of 2; 0 more have none)"

    def test_nobody_holding_has_no_lines(self):
        assert stance.lines([{"found": True}]) == []


class Answering:
    """A service that answers every search with the same grasp, or with none."""

    def __init__(self, grasp):
        self.grasp, self.asked = grasp, []

    def find(self, request):
        self.asked.append(request)
        return {"grasp": self.grasp}


class TestSeek:
    def test_first_fitting_grasp_ends_the_search(self):
        service = Answering(reply(opposite()))
        assert stance.has_fitting(service, {"object": "objects/block"}, scene_of(GIVER), "left")
        assert len(service.asked) == 1

    def test_receivers_without_any_grasp_are_asked_once(self):
        service = Answering(None)
        assert not stance.has_fitting(service, {"object": "objects/block"}, scene_of(GIVER), "left")
        assert len(service.asked) == stance.RECEIVERS

    def test_cones_point_from_the_receiver_to_the_giver(self):
        for direction, reach in stance.wishes(scene_of(GIVER), "right"):
            assert np.isclose(np.linalg.norm(direction), 1)
            assert reach["client_shoulder"][2] < -0.1

    def test_constraints_of_the_request_stay(self):
        service = Answering(None)
        request = {"object": "objects/block", "constraints": {"max_comfort_e": 0.1}}
        stance.has_fitting(service, request, scene_of(GIVER), "left")
        assert all(asked["constraints"]["max_comfort_e"] == 0.1 for asked in service.asked)


def columns_of(view, colour):
    """The columns of the pixels whose hue is that of a colour."""
    wanted = mannequin.COLOURS[colour] / np.linalg.norm(mannequin.COLOURS[colour])
    lengths = np.linalg.norm(view, axis=2)
    return np.flatnonzero(((view @ wanted) / np.maximum(lengths, 1e-9) > 0.9999).any(axis=0))


def views_of(scene, grasp):
    image = mannequin.picture(scene, grasp)
    assert image.shape == (mannequin.SIZE, 2 * mannequin.SIZE, 3)
    return image[:, : mannequin.SIZE - 1], image[:, mannequin.SIZE : -1]


def test_giver_is_on_the_left_of_a_receiver_who_fits():
    for view in views_of(scene_of(GIVER), reply(opposite())):
        giver, receiver = columns_of(view, mannequin.GIVER_ARM), columns_of(view, mannequin.FITTING_ARM)
        assert len(giver) and len(receiver) and giver.mean() < receiver.mean()
        assert not len(columns_of(view, mannequin.WRONG_ARM))


def test_receiver_who_does_not_fit_is_red():
    hand = straight_hand("right", [0.1, 1.2, 0.0])
    for view in views_of(scene_of(GIVER), reply(hand)):
        assert len(columns_of(view, mannequin.WRONG_ARM)) and not len(columns_of(view, mannequin.FITTING_ARM))


def test_arm_that_fits_has_its_lengths():
    _, receiver, fits = mannequin.people(scene_of(GIVER), reply(opposite()))
    assert fits
    assert np.isclose(np.linalg.norm(receiver.shoulder - receiver.elbow), stance.UPPER_ARM)


def test_nobody_holding_leaves_the_receiver_alone():
    giver, _, fits = mannequin.people(scene_of(None), reply(opposite()))
    assert giver is None and fits is None
    for view in views_of(scene_of(None), reply(opposite())):
        assert len(columns_of(view, mannequin.FITTING_ARM)) and not len(columns_of(view, mannequin.GIVER_ARM))


def test_head_is_above_the_shoulders_and_the_other_shoulder_across():
    person = mannequin.owner_of(straight_hand("right", [0.0, 1.2, 0.0], ABOUT), np.array([0.0, 1.0, 0.0]))
    body, arm = mannequin.capsules_of(person, np.array([0.0, 1.0, 0.0]))
    assert body.ends[:, 1].max() > person.shoulder[1] + 0.2
    assert np.allclose(body.ends[2] - body.starts[2], -2 * stance.HALF_SHOULDERS * person.outward)
    assert np.allclose(arm.ends[1], [0.0, 1.2, 0.0])


def test_captions_are_green_only_if_the_receiver_fits():
    row = stance.judge(scene_of(GIVER), reply(opposite()))
    text, colour = mannequin.caption(row)
    assert "off giver's 180°" in text and colour == "#207020"
    assert mannequin.caption({**row, "giver_angle": 30.0})[1] == "#b02020"


def test_sheet_has_the_pictures_of_the_run(tmp_path):
    (tmp_path / "pictures").mkdir()
    row = {"object": "remote", "holdout": "random 0", "picture": "remote-00.png"}
    row |= stance.judge(scene_of(GIVER), reply(opposite()))
    assert not mannequin.sheet(tmp_path, [row])
    file = mannequin.file_of(tmp_path / "pictures" / "remote-00-alone.png")
    matplotlib.image.imsave(file, mannequin.picture(scene_of(GIVER), reply(opposite())))
    assert mannequin.sheet(tmp_path, [row]) and (tmp_path / "stance.png").exists()


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


class TestTableOfChoices:
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
        relations.save(tmp_path, [report.Target("end-on", "≤ 34 %", "49 % (49 of 100)", False)])
        text = relations.table([report.Target("end-on", "≤ 34 %", "30 % (30 of 100)", True)], tmp_path)
        assert "| end-on | 30 % (30 of 100) | 49 % (49 of 100) | -19 |" in text

    def test_figures_without_numbers_have_no_difference(self):
        assert relations.difference("none", "3 %") == ""
