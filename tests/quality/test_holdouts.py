"""Givers keep their whole hand off the object, palm and wrist included."""

import numpy as np
import pytest

import holdouts
from hand import CHAINS, METACARPALS, WRIST


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
