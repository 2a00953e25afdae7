"""The measures of two hands that hold an object together."""

import dataclasses

import measures

# Of these, the smaller value of both hands counts, and of others the larger.
LEAST = {
    "giver_hand",
    "giver_forearm",
    "own_forearm",
    "self_clearance",
    "forbidden_distance",
    "type_confidence",
    "reported_epsilon",
}
HANDEDNESS = ("right", "left")


def judge(scene, grasps):
    """All measures of a right and a left hand by name: forces and closure of both together, of others the worse.

    Nobody holds the object out, so each hand is judged as clear of the other as of a giver.
    """
    hands = [measures.hand_of_reply(grasp) for grasp in grasps]
    rows = []
    for i, grasp in enumerate(grasps):
        beside = dataclasses.replace(scene, giver=hands[1 - i], asked_handedness=HANDEDNESS[i])
        rows.append(measures.judge(beside, grasp))
    contacts = [contact for grasp in grasps for contact in measures.in_object_frame(scene, grasp)[1]]
    return {
        **{name: worse(name, [row[name] for row in rows]) for name in rows[0] if name in rows[1]},
        **measures.forces(scene, contacts, scene.rotation.inv().apply(scene.up)),
        **measures.epsilon(scene, contacts),
    }


def worse(name, values):
    """The worse of both hands' values of a measure; of texts and of what a reply leaves out, the first there is."""
    if any(value is None or isinstance(value, str) for value in values):
        return next((value for value in values if value), values[0])
    return min(values) if name in LEAST else max(values)
