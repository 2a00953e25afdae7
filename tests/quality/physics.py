"""Does the hand keep hold of the object in a physics engine (MuJoCo), which knows nothing of the search?

The world is the object's frame. Wrist and palm do not move; each phalanx is a body on a hinge, its joint's pitch (yaw is
held). First both hold, as in every handover: the object stays where it is while the digits find what they press with;
then the giver lets go. Flesh is the judge's capsules, in slices of even radius; the object is its convex pieces.

What the fingers do. Each hinge has a constant torque, which makes the digit press on the object with the forces (and
torsions) that the reply tells: the torque about the hinge of all forces on the phalanges beyond it. Beside it, each hinge
holds the posture that it has when the giver lets go like a damped spring of limited strength, as a hand that grips does:
where nothing moves the spring adds nothing, so what presses is the answered forces. The palm presses back and does no more.
"""

import enum
from dataclasses import dataclass

import mujoco
import numpy as np

import convex
from hand import CHAINS, DIGITS, HALF_TURN, PHALANGES
from measures import GRAVITY, TORSION_RADIUS

# Seconds of each stage and of a step. With steps of 0.5 ms, 11 of fourteen grasps survived gravity
# instead of 10, and 39 pushes instead of 37.
SETTLING, PUSHING, STEP = 1.0, 2.0, 0.002
# Seconds for which the giver still holds: a handover takes some tenths of a second (Mason and MacKenzie 2005, from
# memory). It takes out what the touch of the answered pose adds: its pads are half a millimetre deep, which between
# posture and object pressed with up to ten times the answered forces. Of the same 75 grasps, which pressed gently, 79 %
# survived gravity and 55 % all pushes with that addition, and 72 % and 37 % without it.
HANDING = 0.25
# Steps from one look at the object to the next; what falls is seen a little later.
STRIDE = 5
# A push is so many newtons for each kilogram of the object: about its weight.
PUSH = 10.0
# The object is lost when it is farther from where it was answered to be: metres and degrees.
LOST_DISTANCE, LOST_ANGLE = 0.05, 15.0
# Posture as a spring: newtons for each metre at a finger's tip, all three joints giving way alike. Of the order of what
# is told of index fingers that press (200 to 800 N/m, Hajian and Howe 1997, from memory); with twice and four times as
# much, of fourteen grasps at most one more or fewer survived gravity.
TIP_STIFFNESS = 500.0
# The spring's damping in seconds: torque for each rate over torque for each angle. Smaller rings, larger creeps.
DAMPING_TIME = 0.03
# Most that the spring adds, as newtons at the tip; a strong finger presses with 27 N in all, and with that much here as
# many of fourteen grasps were held.
POSTURE_STRENGTH = 10.0
# Inertia of tendon and muscle at each hinge in kg m^2, which keeps the light phalanges stable.
ARMATURE = 1e-5
# Skin's density in kg/m^3: what phalanges weigh; gravity does not pull them, the arm bears them.
DENSITY = 1100.0
# A tapered capsule is cut into so many slices that radii within one differ by at most this; half of it is the error.
TAPER = 0.0005
# Flesh as soft contacts: their time constant in seconds, and impedances at first touch and at a depth of FLESH_DEPTH
# metres. Under 5 N a fingertip sinks in by 0.3 mm. A ball that overlaps the palm by 2 mm at the start is pushed out at
# 0.17 m/s, which a rise of 1.5 mm stops. This matters: at half the time constant, 8 of fourteen grasps survived gravity
# instead of 10, and 32 pushes instead of 37.
CONTACT_TIME, IMPEDANCES, FLESH_DEPTH = 0.005, (0.9, 0.99), 0.001
# Friction's stiffness over the normal one's (MuJoCo's impratio): lower lets what is held creep.
FRICTION_STIFFNESS = 20.0
DIRECTIONS = ["+x", "-x", "+y", "-y", "+z", "-z"]


class Fate(enum.Enum):
    """How a run ended; the strings are those of the report."""

    HELD = "held"
    SLIPPED = "slipped"
    TURNED = "turned"


@dataclass
class Outcome:
    """The farthest that the object was from where it had been answered to be, in metres and degrees."""

    fate: Fate
    distance: float
    angle: float

    @property
    def held(self):
        return self.fate is Fate.HELD


@dataclass
class Object:
    """What is held, in its own frame: convex pieces, kilograms, metres."""

    pieces: list
    mass: float
    centre_of_mass: np.ndarray
    friction: float


def simulate(thing, hand, contacts, up, axes=np.eye(3), pushes=DIRECTIONS):
    """Outcomes by name: "gravity", and each push that gravity was survived for.

    `hand` (None: nothing holds the object), `contacts` and `up` are in the object's frame; pushes go along the rows of
    `axes`, of both signs.
    """
    model = mujoco.MjModel.from_xml_string(world(thing, hand, contacts, -GRAVITY * np.asarray(up)))
    data = mujoco.MjData(model)
    for joint, torque in torques(hand, contacts).items() if hand else ():
        data.qfrc_applied[model.joint(joint).dofadr[0]] = torque
    hand_over(model, data)
    outcomes = {"gravity": run(model, data, thing, SETTLING)}
    settled = data.qpos.copy(), data.qvel.copy(), data.qacc_warmstart.copy()
    if outcomes["gravity"].held:
        for name in pushes:
            data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = settled
            sign, axis = (1 if name[0] == "+" else -1), "xyz".index(name[1])
            data.xfrc_applied[model.body("object").id, :3] = sign * PUSH * thing.mass * axes[axis]
            outcomes[name] = run(model, data, thing, PUSHING)
    return outcomes


def hand_over(model, data):
    """The digits find what they press with while the giver holds the object; then the posture is kept, and the giver lets
    go."""
    hinges = model.jnt_qposadr[model.actuator_trnid[:, 0]]
    for _ in range(round(HANDING / STEP)):
        # A posture that follows adds nothing.
        data.ctrl[:] = data.qpos[hinges]
        mujoco.mj_step(model, data)
    data.eq_active[:] = 0


def run(model, data, thing, seconds):
    """Steps on until the time is over or the object is lost."""
    farthest = widest = 0.0
    held = True
    for _ in range(round(seconds / (STEP * STRIDE))):
        mujoco.mj_step(model, data, STRIDE)
        # The body's frame is the object's; it began as the world's.
        place, turn = data.qpos[:3], data.qpos[3:7]
        angle = np.degrees(2 * np.arctan2(np.linalg.norm(turn[1:]), abs(turn[0])))
        moved = np.empty(3)
        mujoco.mju_rotVecQuat(moved, thing.centre_of_mass, turn)
        distance = np.linalg.norm(place + moved - thing.centre_of_mass)
        farthest, widest = max(farthest, distance), max(widest, angle)
        # A state that is no number is lost, too.
        held = farthest <= LOST_DISTANCE and widest <= LOST_ANGLE and np.isfinite(distance + angle)
        if not held:
            break
    fate = Fate.HELD if held else Fate.TURNED if farthest <= LOST_DISTANCE else Fate.SLIPPED
    return Outcome(fate, float(farthest), float(widest))


def torques(hand, contacts):
    """The constant torque of each hinge in newton metres, by the hinge's name.

    The digit's forces on the object are those of the reply; the object pushes back as much. What balances that about a
    hinge is the transpose of the Jacobian of the contacts beyond it times the forces.
    """
    result = {}
    for digit, chain in enumerate(CHAINS):
        axes = hinge_axes(hand, chain)
        for phalanx in range(3):
            total = 0.0
            for contact in contacts:
                if contact["digit"] != DIGITS[digit] or PHALANGES.index(contact["phalanx"]) < phalanx:
                    continue
                arm = contact["position"] - hand.positions[chain[phalanx]]
                moment = np.cross(arm, contact["force"]) - (contact["torsion"] or 0.0) * contact["normal"]
                total += float(axes[phalanx] @ moment)
            result[f"{DIGITS[digit]} {PHALANGES[phalanx]}"] = total
    return result


def hinge_axes(hand, chain):
    """The axes of a digit's three pitches."""
    return [(hand.rotations[joint] * HALF_TURN).apply([1.0, 0.0, 0.0]) for joint in chain[:3]]


def world(thing, hand, contacts, gravity):
    """The scene in MuJoCo's format. All bodies are turned as the world is, so places are differences of places."""
    friction = f"{thing.friction:.6g} {thing.friction * TORSION_RADIUS:.6g} 0.0001"
    low, high = IMPEDANCES
    held = "".join(
        f'<geom name="piece {i}" type="mesh" mesh="piece {i}" class="object"/>' for i in range(len(thing.pieces))
    )
    inertia = thing.mass * convex.unit_inertia(thing.pieces)
    entries = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    bodies, servos = hand_bodies(hand) if hand else ("", "")
    return f"""<mujoco>
<compiler angle="radian" balanceinertia="true"/>
<option timestep="{STEP}" gravity="{numbers(gravity)}" integrator="implicitfast" cone="elliptic"
  impratio="{FRICTION_STIFFNESS}"/>
<default>
  <geom condim="4" friction="{friction}" solref="{CONTACT_TIME} 1" solimp="{low} {high} {FLESH_DEPTH}"
    density="{DENSITY}"/>
  <default class="object"><geom contype="0" conaffinity="1"/></default>
  <default class="hand"><geom type="capsule" contype="1" conaffinity="0"/></default>
</default>
<asset>{"".join(f'<mesh name="piece {i}" inertia="shell" vertex="{numbers(p.ravel())}"/>'
                for i, p in enumerate(thing.pieces))}</asset>
<worldbody>
  <body name="object"><freejoint/>
    <inertial pos="{numbers(thing.centre_of_mass)}" mass="{thing.mass}" fullinertia="{numbers(entries)}"/>
    {held}
  </body>
  {bodies}
</worldbody>
<equality><weld name="giver" body1="object" solref="{STEP * 2.5} 1"/></equality>
<actuator>{servos}</actuator>
</mujoco>"""


def hand_bodies(hand):
    """The fixed palm and the digits' chains of phalanges, and the springs that hold the posture."""
    capsules, tags = hand.solids()
    palm = "".join(slices(capsules, row, np.zeros(3)) for row in np.flatnonzero(tags[:, 0] < 0))
    text, servos = [f'<body name="palm">{palm}</body>'], []
    for digit, chain in enumerate(CHAINS):
        places, axes = hand.positions[chain], hinge_axes(hand, chain)
        for phalanx in range(3):
            name = f"{DIGITS[digit]} {PHALANGES[phalanx]}"
            offset = places[phalanx] - (places[phalanx - 1] if phalanx else 0.0)
            row = int(np.flatnonzero((tags == (digit, phalanx)).all(axis=1))[0])
            # What is beyond the hinge; in a row of three, each gives way by a third.
            lever = np.linalg.norm(np.diff(places[phalanx:], axis=0), axis=1).sum()
            stiffness, strongest = 3 * TIP_STIFFNESS * lever**2, POSTURE_STRENGTH * lever
            text.append(
                f'<body name="{name}" pos="{numbers(offset)}" gravcomp="1"><joint name="{name}"'
                f' axis="{numbers(axes[phalanx])}" armature="{ARMATURE}" damping="{DAMPING_TIME * stiffness:.6g}"/>'
                f"{slices(capsules, row, places[phalanx])}"
            )
            servos.append(
                f'<position joint="{name}" kp="{stiffness:.6g}" forcelimited="true"'
                f' forcerange="{-strongest:.6g} {strongest:.6g}"/>'
            )
        text.append("</body>" * 3)
    return "".join(text), "".join(servos)


def slices(capsules, row, origin):
    """A tapered capsule as capsules of even radius, as seen from `origin`."""
    start, end = capsules.starts[row] - origin, capsules.ends[row] - origin
    r, q = capsules.start_radii[row], capsules.end_radii[row]
    # At least two, so that a straight one lies on a plane with two contacts and not one.
    count = max(2, int(np.ceil(abs(r - q) / TAPER)))
    text = []
    for i in range(count):
        a, b, middle = i / count, (i + 1) / count, (i + 0.5) / count
        ends = np.concatenate([start + a * (end - start), start + b * (end - start)])
        radius = r + middle * (q - r)
        # MuJoCo refuses a capsule without length.
        shape = f'fromto="{numbers(ends)}"' if np.linalg.norm(ends[:3] - ends[3:]) > 1e-6 else (
            f'type="sphere" pos="{numbers(ends[:3])}"')  # fmt: skip
        text.append(f'<geom class="hand" {shape} size="{radius:.6g}"/>')
    return "".join(text)


def numbers(values):
    """Numbers for an attribute."""
    return " ".join(f"{value:.9g}" for value in values)
