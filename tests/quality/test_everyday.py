"""Everyday objects: their files, the choice of givers, the report, and a few of them judged with a real server."""

import argparse

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import everyday
import hand as hands
import judge
import pool
import report
from mesh import Mesh
from service import ROOT, Service
from shapes import BOX_FACES, box


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
        assert everyday.leaves_room(left, right)

    def test_hands_at_one_place_leave_no_room(self):
        hand = straight_hand("right", self.ends[0])
        assert not everyday.leaves_room(hand, straight_hand("right", self.ends[0] + [0.02, 0.0, 0.0]))

    def test_receiver_must_be_a_right_hand(self):
        left, right = straight_hand("left", self.ends[0]), straight_hand("right", self.ends[1])
        assert everyday.givers_among([left, right]) == [left]

    def test_no_more_givers_than_wanted(self):
        near = [straight_hand("right", self.ends[0] + [0.001 * k, 0.0, 0.0]) for k in range(5)]
        chosen = everyday.givers_among([*near, straight_hand("right", self.ends[1])])
        assert chosen == near[: everyday.GIVERS]

    def test_request_carries_the_joints_of_the_giver(self):
        giver = straight_hand("left", self.ends[0])
        form = everyday.request("objects/rod", giver)["presenting_hand"]["joints"]
        again = hands.Hand.from_joints(form["handedness"], form["joints"])
        assert again.handedness == "left"
        assert np.allclose(again.positions, giver.positions)
        assert "presenting_hand" not in everyday.request("objects/rod")


class TestReport:
    rows = [
        row(),
        row(holdout="giver 1", milliseconds=400.0, in_time=False),
        row("pan", found=False, in_time=False),
        {"object": "remote", "holdout": "random 0", "everyday": False, "found": True, "in_time": True},
    ]

    def test_counts_only_everyday_objects_each_kind_by_itself(self):
        assert everyday.shares(self.rows) == [(2, 1), (1, 0)]

    def test_targets_are_the_shares_in_time(self):
        alone, given = report.within_reach(self.rows)
        assert (alone.wanted, alone.figure, alone.met) == ("≥ 95 %", "50.0 % (1 of 2)", False)
        assert (given.wanted, given.figure, given.met) == ("≥ 90 %", "0.0 % (0 of 1)", False)
        assert report.within_reach(self.rows[3:]) == []

    def test_what_is_beyond_one_hand_counts_by_itself(self):
        held, lost = {"survives_gravity": True, "survives_pushes": 5}, {"survives_gravity": False, "survives_pushes": 0}
        rows = [{**row("tray", f"both hands {k}"), "both": True, **fate} for k, fate in enumerate([held, lost])]
        assert everyday.shares(rows) == [(0, 0), (0, 0)]
        (target,) = report.held_by_both(self.rows + rows)
        assert (target.wanted, target.figure, target.met) == ("≥ 80 %", "50 % (1 of 2)", False)
        assert report.held_by_both(self.rows) == []
        known = {"tray": everyday.Thing("tray", 2.0, 0.5, None, [], "5 N m")}
        assert "| tray | 5 N m | 2 of 2 | 3.0 | 1 of 2 | 5 of 12 |" in everyday.table(rows, known)

    def test_table_says_what_is_late_or_missing(self):
        thing = {"mass_kg": 0.3, "friction": 0.5, "centre_of_mass": None, "forbidden": [], "beyond": ""}
        known = {name: everyday.Thing(name, **thing) for name in ("mug", "pan")}
        text = everyday.table(self.rows, known)
        assert "| mug | 0.3 | 3.00 ms, medium wrap | **late**, 400.00 ms | no room | no room |" in text
        assert "| pan | 0.3 | **none** |" in text
        assert everyday.table(self.rows[3:], known) == ""


def test_a_box_is_closed_and_without_a_face_it_is_not():
    assert Mesh(box((1, 1, 1)), BOX_FACES).closed()
    assert not Mesh(box((1, 1, 1)), BOX_FACES[1:]).closed()


needs_programs = pytest.mark.skipif(
    not all((ROOT / "target/release" / name).exists() for name in ("grasp", "grasp-server", "grasp-everyday")),
    reason="no release binaries of grasp, grasp-server and grasp-everyday",
)


@needs_programs
def test_every_mesh_has_the_groups_and_the_mass_that_its_manifest_names():
    things = everyday.things()
    assert len(things) >= 60
    for thing in things.values():
        mesh = Mesh.read_obj(everyday.mesh_file(thing.name))
        assert set(thing.forbidden) <= set(mesh.groups), thing.name
        assert thing.mass_kg > 0 and 0.2 < thing.friction < 1.0, thing.name
        if thing.centre_of_mass:
            centre = np.array(thing.centre_of_mass)
            assert ((mesh.low - 1e-4 <= centre) & (centre <= mesh.high + 1e-4)).all(), thing.name


@needs_programs
def test_a_server_takes_everyday_objects_alone_and_from_givers():
    things = everyday.things()
    options = argparse.Namespace(choice=None, no_atlas=False)
    with Service(None, "--builder-threads", "0") as service:
        givers = everyday.make_givers(service, [things["stick"]], seed=1)["stick"]
        assert givers, "a stick of 1.3 m leaves room for two hands"
        for name in ["pen", "mug"]:
            created = everyday.create(service, things[name])
            assert created["mass_kg"] == pytest.approx(things[name].mass_kg)
            assert created["friction"] == pytest.approx(things[name].friction)
        names = ["pen", "mug", "stick"]
        wanted = [request for name in names for _, request, _ in everyday.requests(things[name], [], seed=1)]
        wanted += [request for _, request, _ in everyday.requests(things["stick"], givers, seed=1)]
        for request in wanted:
            answer, _ = judge.ask(service, {**request, "seed": "1"}, options)
            assert answer["outcome"] == "found", request["object"]


@needs_programs
def test_two_hands_of_a_server_hold_a_box_that_one_cannot(tmp_path):
    things = everyday.things()
    options = argparse.Namespace(
        choice=None, no_atlas=False, seeds=1, seed=1, sample=0, rig=None, hand="right", validity=None, strategy=None
    )
    with Service(None, "--builder-threads", "0") as service:
        asked = list(judge.cases("moving-box", service, options, [], things["moving-box"]))
        assert len(asked) == everyday.BOTH_SEARCHES
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
