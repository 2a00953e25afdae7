"""Finds out whether any valid grasp of a holdout fits a plausible receiver.

The server is asked again with the shoulders of several plausible receivers and with cones around the directions from
which they would take the object.
"""

import time

import numpy as np

import stance

# Time for one holdout and for one request, in seconds.
SECONDS, REQUEST_SECONDS = 5.0, 1.0
# Plausible receivers to ask for.
RECEIVERS = 6
# Half angles of the cones in radians, by turns. A hand approaches at 45° to its forearm, so a narrower cone would leave
# out straight wrists.
HALF_ANGLES = (1.3, 1.0)
# From an object's middle to the wrist of a hand that holds it, in metres.
HAND_LENGTH = 0.12


def wishes(scene, handedness):
    """Constraints toward plausible receivers with an elbow within reach, as different as possible."""
    middle = scene.translation + scene.rotation.apply((scene.mesh.low + scene.mesh.high) / 2)
    bodies = stance.receivers(scene.giver, scene.up, handedness)
    # The wrist is between object and shoulder.
    near = middle + HAND_LENGTH * stance.unit(bodies.shoulders.mean(axis=0) - middle)
    elbows, owners = stance.elbows(near, bodies, scene.up)
    if len(elbows) == 0:
        owners = np.arange(len(bodies.shoulders))
        elbows = near + stance.FOREARM * stance.unit(bodies.shoulders - near)
    directions = stance.unit(elbows - near)
    chosen = [int(np.argmax(directions @ stance.unit(directions.sum(axis=0))))]
    while len(chosen) < min(RECEIVERS, len(directions)):
        chosen.append(int(np.argmax((1 - directions @ directions[chosen].T).min(axis=1))))
    reach = stance.UPPER_ARM + stance.FOREARM
    for pick in chosen:
        shoulder = bodies.shoulders[owners[pick]]
        yield (-directions[pick]).tolist(), {"client_shoulder": shoulder.tolist(), "reach": reach}


def has_fitting(service, request, scene, handedness):
    """Whether a search within SECONDS finds a valid grasp that fits a plausible receiver."""
    until = time.monotonic() + SECONDS
    asked = list(wishes(scene, handedness))
    turn = 0
    while asked and time.monotonic() < until:
        hopeless = []
        for wish in asked:
            direction, reach = wish
            half_angle = HALF_ANGLES[turn % len(HALF_ANGLES)]
            constraints = {
                **(request.get("constraints") or {}),
                "receiver_reach": reach,
                "approach": {"client_direction": direction, "half_angle": half_angle},
            }
            more = {"seed": str(turn), "budget_seconds": REQUEST_SECONDS, "constraints": constraints}
            grasp = service.find({**request, **more})["grasp"]
            if grasp is None:
                hopeless.append(wish)
            elif stance.fits(scene, grasp):
                return True
            if time.monotonic() > until:
                break
        asked = [wish for wish in asked if wish not in hopeless]
        turn += 1
    return False
