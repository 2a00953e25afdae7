"""Contacts of the palm, which have neither digit nor phalanx in the reply."""

import numpy as np
import pytest

import hand as hands
import measures
from mesh import Mesh
from shapes import BOX_FACES, box
from test_judge import faults, good, judged


class TestPalmContact:
    """Adds a third contact: a plate against the middle of the palm."""

    def with_plate(self, off=0.0):
        scene, grasp, direction = good()
        hand = measures.hand_of_reply(grasp)
        capsules, tags = hand.solids()
        # On the palmar side of the middle finger's metacarpal.
        row = next(i for i, tag in enumerate(tags) if tag[0] < 0 and np.allclose(
            capsules.starts[i], hand.positions[hands.METACARPALS[1]]))  # fmt: skip
        palmar = hand.rotations[hands.METACARPALS[1]].apply([0, -1, 0])
        centre, radius = capsules.at(np.full(len(capsules), 0.5))
        point = centre[row] + (radius[row] + off) * palmar
        axis = capsules.directions[row]
        palmar = palmar - palmar @ axis * axis
        palmar /= np.linalg.norm(palmar)
        plate = box([0.003, 0.003, 0.001], point + 0.001 * palmar, np.stack(
            [axis, np.cross(palmar, axis), palmar]))  # fmt: skip
        count = len(scene.mesh.vertices)
        faces = np.concatenate([scene.mesh.faces, np.array(BOX_FACES) + count])
        scene.mesh = Mesh(np.concatenate([scene.mesh.vertices, scene.to_object(plate)]), faces)
        grasp["contacts"].append(
            {"client_position": point, "client_normal": -palmar, "client_force": 1e-9 * palmar,
             "digit": None, "phalanx": None}
        )  # fmt: skip
        return scene, grasp

    def test_a_contact_on_the_palm_has_no_fault_and_no_share_of_comfort(self):
        scene, grasp = self.with_plate()
        assert faults(scene, grasp) == set()
        row = judged(scene, grasp)
        assert (row["contacts"], row["digits_touching"], row["palm_touching"]) == (3, 2, True)
        # However hard the palm presses, only the digits count for comfort.
        grasp["contacts"][2]["client_force"] = 5e9 * np.array(grasp["contacts"][2]["client_force"])
        assert judged(scene, grasp)["comfort"] == pytest.approx(0.0, abs=1e-9)

    def test_finds_a_contact_off_the_palm(self):
        scene, grasp = self.with_plate(off=0.003)
        assert faults(scene, grasp) == {"off_skin"}

    def test_finds_a_contact_on_a_finger_labelled_as_the_palm(self):
        scene, grasp, _ = good()
        grasp["contacts"][1].update(digit=None, phalanx=None)
        assert "off_skin" in faults(scene, grasp)
