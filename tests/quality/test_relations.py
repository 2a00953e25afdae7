"""Grasp types in replies, the report's tables over many grasps, and the drawing."""

import numpy as np
import pytest

import draw
import measures
import relations
import report
from test_judge import good


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
