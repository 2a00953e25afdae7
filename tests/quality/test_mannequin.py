"""Pictures of giver and receiver: who is drawn where."""

import matplotlib.image
import numpy as np

import mannequin
import stance
from test_stance import ABOUT, GIVER, opposite, reply, scene_of, straight_hand


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
