"""Everyday objects: their files, the choice of givers, the report, and a few of them judged with a real server."""

import argparse

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import draw
import hand as hands
import holdouts
import judge
import measures
import pool
import relations
import report
from hand import CHAINS, METACARPALS, WRIST
from service import ROOT, Service
from solids import Mesh
from test_geometry import box, BOX_FACES
from test_judge import good


def straight_hand(handedness, position, turn=None):
    """A stretched hand whose wrist is at a position; unturned, its fingers point along -z."""
    flat = [{"base_yaw": 0.0, "base_pitch": 0.0, "second_pitch": 0.0}] * 5
    turn = turn or Rotation.identity()
    return hands.posed("adult", handedness, position, turn.as_quat(), flat)


def row(name="mug", holdout="alone", milliseconds=3.0, found=True, in_time=True):
    """A row of the judge for an everyday object."""
    return {
        "object": name,
        "holdout": holdout,
        "everyday": True,
        "found": found,
        "in_time": in_time,
        "search_ms": milliseconds,
        "type": "medium_wrap",
    }


class TestGivers:
    # The wrists of hands next to each other, far enough apart.
    ends = [np.array([x, 0.05, 0.1]) for x in (-0.35, 0.35)]

    def test_hands_far_apart_leave_room_for_each_other(self):
        left, right = straight_hand("right", self.ends[0]), straight_hand("right", self.ends[1])
        assert holdouts.leaves_room(left, right)

    def test_hands_at_one_place_leave_no_room(self):
        hand = straight_hand("right", self.ends[0])
        assert not holdouts.leaves_room(hand, straight_hand("right", self.ends[0] + [0.02, 0.0, 0.0]))

    def test_receiver_must_be_a_right_hand(self):
        left, right = straight_hand("left", self.ends[0]), straight_hand("right", self.ends[1])
        assert holdouts.givers_among([left, right]) == [left]

    def test_no_more_givers_than_wanted(self):
        near = [straight_hand("right", self.ends[0] + [0.001 * k, 0.0, 0.0]) for k in range(5)]
        chosen = holdouts.givers_among([*near, straight_hand("right", self.ends[1])])
        assert chosen == near[: holdouts.GIVERS]

    def test_request_carries_the_joints_of_the_giver(self):
        giver = straight_hand("left", self.ends[0])
        form = holdouts.request("objects/rod", giver)["presenting_hand"]["joints"]
        again = hands.Hand.from_joints(form["handedness"], form["joints"])
        assert again.handedness == "left"
        assert np.allclose(again.positions, giver.positions)
        assert "presenting_hand" not in holdouts.request("objects/rod")


class TestReport:
    rows = [
        row(),
        row(holdout="giver 1", milliseconds=400.0, in_time=False),
        row("pan", found=False, in_time=False),
        {"object": "remote", "holdout": "random 0", "everyday": False, "found": True, "in_time": True},
    ]

    def test_counts_only_everyday_objects_each_kind_by_itself(self):
        assert holdouts.shares(self.rows) == [(2, 1), (1, 0)]

    def test_targets_are_the_shares_in_time(self):
        alone, given = report.within_reach(self.rows)
        assert (alone.wanted, alone.figure, alone.met) == ("≥ 95 %", "50.0 % (1 of 2)", False)
        assert (given.wanted, given.figure, given.met) == ("≥ 90 %", "0.0 % (0 of 1)", False)
        assert report.within_reach(self.rows[3:]) == []

    def test_what_is_beyond_one_hand_counts_by_itself(self):
        held, lost = {"survives_gravity": True, "survives_pushes": 5}, {"survives_gravity": False, "survives_pushes": 0}
        rows = [{**row("tray", f"both hands {k}"), "both": True, **fate} for k, fate in enumerate([held, lost])]
        assert holdouts.shares(rows) == [(0, 0), (0, 0)]
        (target,) = report.held_by_both(self.rows + rows)
        assert (target.wanted, target.figure, target.met) == ("≥ 80 %", "50 % (1 of 2)", False)
        assert report.held_by_both(self.rows) == []
        known = {"tray": holdouts.Thing("tray", 2.0, 0.5, None, [], "5 N m")}
        assert "| tray | 5 N m | 2 of 2 | 3.0 | 1 of 2 | 5 of 12 |" in holdouts.table(rows, known)

    def test_table_says_what_is_late_or_missing(self):
        thing = {"mass_kg": 0.3, "friction": 0.5, "centre_of_mass": None, "forbidden": [], "beyond": ""}
        known = {name: holdouts.Thing(name, **thing) for name in ("mug", "pan")}
        text = holdouts.table(self.rows, known)
        assert "| mug | 0.3 | 3.00 ms, medium wrap | **late**, 400.00 ms | no room | no room |" in text
        assert "| pan | 0.3 | **none** |" in text
        assert holdouts.table(self.rows[3:], known) == ""


def test_a_box_is_closed_and_without_a_face_it_is_not():
    assert Mesh(box((1, 1, 1)), BOX_FACES).closed()
    assert not Mesh(box((1, 1, 1)), BOX_FACES[1:]).closed()


needs_programs = pytest.mark.skipif(
    not all((ROOT / "target/release" / name).exists() for name in ("grasp", "grasp-server", "grasp-everyday")),
    reason="no release binaries of grasp, grasp-server and grasp-everyday",
)


@needs_programs
def test_every_mesh_has_the_groups_and_the_mass_that_its_manifest_names():
    things = holdouts.things()
    assert len(things) >= 60
    for thing in things.values():
        mesh = Mesh.read_obj(holdouts.mesh_file(thing.name))
        assert set(thing.forbidden) <= set(mesh.groups), thing.name
        assert thing.mass_kg > 0 and 0.2 < thing.friction < 1.0, thing.name
        if thing.centre_of_mass:
            centre = np.array(thing.centre_of_mass)
            assert ((mesh.low - 1e-4 <= centre) & (centre <= mesh.high + 1e-4)).all(), thing.name


@needs_programs
def test_a_server_takes_everyday_objects_alone_and_from_givers():
    things = holdouts.things()
    options = argparse.Namespace(choice=None, no_atlas=False)
    with Service(None, "--builder-threads", "0") as service:
        givers = holdouts.make_givers(service, [things["stick"]], seed=1)["stick"]
        assert givers, "a stick of 1.3 m leaves room for two hands"
        for name in ["pen", "mug"]:
            created = holdouts.create(service, things[name])
            assert created["mass_kg"] == pytest.approx(things[name].mass_kg)
            assert created["friction"] == pytest.approx(things[name].friction)
        names = ["pen", "mug", "stick"]
        wanted = [request for name in names for _, request, _ in holdouts.requests(things[name], [], seed=1)]
        wanted += [request for _, request, _ in holdouts.requests(things["stick"], givers, seed=1)]
        for request in wanted:
            answer, _ = judge.ask(service, {**request, "seed": "1"}, options)
            assert answer["outcome"] == "found", request["object"]


@needs_programs
def test_two_hands_of_a_server_hold_a_box_that_one_cannot(tmp_path):
    things = holdouts.things()
    options = argparse.Namespace(
        choice=None, no_atlas=False, seeds=1, seed=1, sample=0, rig=None, hand="right", validity=None, strategy=None
    )
    with Service(None, "--builder-threads", "0") as service:
        asked = list(judge.cases("moving-box", service, options, [], things["moving-box"]))
        assert len(asked) == holdouts.BOTH_SEARCHES
        _, request, scene = asked[0]
        answer, _ = judge.ask(service, request, options)
    scene.friction = judge.friction_in_force(request, scene.friction, "physical")
    case = pool.Case("moving-box", scene, answer["grasp"], answer["other_grasp"])
    found = pool.judged(case, simulated=True)
    assert report.acceptable(found), report.faults(found)
    assert found["imbalance"] < 0.02 and found["survives_gravity"], found
    # Alone, either hand bears a part of the weight.
    alone = pool.judged(pool.Case("moving-box", scene, answer["grasp"]), simulated=False)
    assert alone["imbalance"] > 0.2 and not found["wrong_chirality"]


class TestTypes:
    @pytest.mark.parametrize(
        ("reply", "expected"),
        [
            ({"type": "GRASP_TYPE_MEDIUM_WRAP", "typeConfidence": 0.75}, ("medium_wrap", 0.75)),
            ({"type": "tip_pinch", "type_confidence": 0.5}, ("tip_pinch", 0.5)),
            ({"type": None, "type_confidence": 0.0}, ("", 0.0)),
            ({"type": "unspecified"}, ("", 0.0)),
        ],
    )
    def test_reads_every_form_of_a_type(self, reply, expected):
        row = measures.reported_type(reply)
        assert (row["type"], row["type_confidence"]) == expected

    def test_ignores_replies_without_types(self):
        assert measures.reported_type({}) == {}
        assert report.classified([{"found": True}]) == []

    def test_reports_the_classified_share_and_the_number_of_types(self):
        rows = [{"type": name, "type_confidence": c} for name, c in [("a", 0.9), ("a", 0.6), ("b", 0.4), ("", 0.9)]]
        share, types = report.classified(rows)
        assert share.figure == "50 % (2 of 4)" and not share.met
        assert types.figure == "1"
        assert "| a | 2 | 50 % | 0.75 |" in relations.types(rows)


class TestRelations:
    def test_chance_to_rank_a_good_grasp_first_counts_all_pairs(self):
        random = np.random.default_rng(5)
        rows = [{"comfort": float(c), "good": bool(g)} for c, g in zip(
            random.integers(0, 6, 40), random.integers(0, 2, 40))]  # fmt: skip
        pairs = [(a["comfort"], b["comfort"]) for a in rows if a["good"] for b in rows if not b["good"]]
        brute = np.mean([1.0 if a < b else 0.5 if a == b else 0.0 for a, b in pairs])
        assert relations.ranked_before(rows, lambda row: row["good"]) == pytest.approx(brute)
        assert relations.ranked_before(rows, lambda row: True) is None

    def test_counts_survival_by_class_of_epsilon(self):
        rows = [
            {"epsilon": e, "survives_gravity": g, "survives_pushes": p, "survives_all": g and p == 6}
            for e, g, p in [(0.001, False, 0), (0.025, True, 3), (0.029, True, 6), (0.09, True, 6)]
        ]
        table = relations.survival_by_epsilon(rows)
        assert "| 0.02 to 0.03 | 2 | 100 % (2) | 75 % | 50 % (1) |" in table
        assert "| 0.08 and more | 1 | 100 % (1) | 100 % | 100 % (1) |" in table
        assert "| all | 4 | 75 % (3) | 62 % | 50 % (2) |" in table
        survival = report.held(rows)
        assert [line.met for line in survival] == [False, False]


class TestDrawing:
    def test_shows_the_nearest_points_in_place(self):
        # Seen from +z with +y up: points to the right, left, top and bottom, and one hidden behind the first.
        points = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [1, 0, -0.5], [0, -1, 0]])
        axes = draw.axes_of(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))
        for order in (np.arange(5), np.arange(5)[::-1]):
            _, nearest = draw.shown(points[order], np.ones(5, int), axes, 100, cover=0)
            at = {order[nearest[y, x]]: (y, x) for y, x in np.argwhere(nearest >= 0)}
            assert set(at) == {0, 1, 2, 4}
            assert at[0][1] > 90 and at[1][1] < 10 and at[2][0] < 10 and at[4][0] > 90

    def test_contacts_are_in_the_picture(self):
        scene, grasp, _ = good()
        image = draw.picture(scene, grasp)
        assert image.shape == (draw.SIZE, draw.SIZE, 3)
        red = (image == draw.COLOURS[draw.CONTACT]).all(axis=2).sum()
        assert red > 20
        grasp["contacts"] = []
        assert not (draw.picture(scene, grasp) == draw.COLOURS[draw.CONTACT]).all(axis=2).any()


def depth_in_hand(hand, points):
    """The largest depth of the points below the skin, computed from the joints and radii alone."""
    deepest = 0.0
    for digit, chain in enumerate(CHAINS):
        joints = [WRIST] + ([METACARPALS[digit - 1]] if digit else []) + chain[:-1]
        for a, b in zip(joints, joints[1:]):
            start, axis = hand.positions[a], hand.positions[b] - hand.positions[a]
            along = np.clip((points - start) @ axis / (axis @ axis), 0, 1)
            radii = hand.radii[a] + along * (hand.radii[b] - hand.radii[a])
            distances = np.linalg.norm(points - start - along[:, None] * axis, axis=1)
            deepest = max(deepest, float((radii - distances).max()))
    return deepest


@pytest.mark.parametrize("name", holdouts.BUILT_IN)
def test_placed_givers_do_not_penetrate_the_object(name):
    mesh = holdouts.load_mesh(name)
    placer, hands = holdouts.Placer(mesh), holdouts.recorded_hands()
    points, _ = mesh.samples()
    random = np.random.default_rng(11)
    for _ in range(4):
        giver = placer.place(hands[random.integers(len(hands))], random)
        assert depth_in_hand(giver, points) < holdouts.GIVER_DEPTH + 0.001


class Placed:
    """The result of a placement: a hand this deep in the object."""

    def __init__(self, depth):
        self.depth = depth

    def solids(self):
        return self, None

    def distances(self, points):
        return np.full(len(points), -self.depth)


def chosen_depth(depths):
    """Given the depths of successive placements, the one that is used, and how many were tried."""
    placer, left = holdouts.Placer(holdouts.load_mesh("remote")), list(depths)
    placer._attempt = lambda hand, random: Placed(left.pop(0))
    return placer.place(None, None).depth, len(depths) - len(left)


def test_uses_the_first_shallow_placement():
    assert chosen_depth([0.02, 0.003, 0.001]) == (0.003, 2)


def test_uses_the_shallowest_placement_if_none_is_shallow():
    deep = [0.02 - 0.0001 * k for k in range(holdouts.PLACEMENTS - 1)] + [0.03, 0.001]
    assert chosen_depth(deep) == (min(deep[:-1]), holdouts.PLACEMENTS)
