"""Simulates the grasp in a physics engine (MuJoCo) that is independent of the search: does the hand keep hold?

The world is the object's frame. Wrist and palm are fixed; each phalanx is a body on a hinge, the pitch of its joint,
while yaw is locked. Flesh is the judge's capsules, cut into slices of constant radius; the object is its convex pieces.
As in every handover, both hands hold at first: the object is fixed while the digits settle at the forces they press
with. Then the giver lets go.

Each hinge has a constant torque that makes its digit press with the forces and torsions of the reply: the torque about
the hinge of all forces on the phalanges beyond it. A damped spring of limited strength holds the posture that the hinge
has when the giver lets go, as a gripping hand does. It adds nothing while nothing moves, so the digits press with the
reply's forces alone. The palm only presses back.
"""

import enum
import hashlib
import os
import pathlib
import tempfile
from dataclasses import dataclass

import coacd
import mujoco
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from hand import CHAINS, DIGITS, HALF_TURN, PHALANGES
from measures import GRAVITY, TORSION_RADIUS

# Seconds of gravity, of each push, and of a time step. Steps of 0.5 ms change the verdict of about one grasp in
# fourteen.
SETTLING, PUSHING, STEP = 1.0, 2.0, 0.002
# Seconds for which the giver still holds: a handover takes some tenths of a second (Mason and MacKenzie 2005, from
# memory). Meanwhile the posture yields to the pads' overlap, which would otherwise press with up to ten times the
# reply's forces.
HANDING = 0.25
# Steps between two checks of the object.
STRIDE = 5
# Force of a push in newtons per kilogram of the object: about its weight.
PUSH = 10.0
# The object is lost when it has moved or turned farther than this, in metres and degrees.
LOST_DISTANCE, LOST_ANGLE = 0.05, 15.0
# A load in hooked fingers may swing: it is lost when the place by which it hangs has moved as far, or it turns over.
LOST_SWING = 60.0
# Stiffness of the posture's spring at a fingertip in newtons per metre, shared evenly by the three joints: that of
# pressing index fingers (200 to 800 N/m, Hajian and Howe 1997, from memory). Twice or four times as much hardly changes
# a verdict.
TIP_STIFFNESS = 500.0
# Damping over stiffness of the spring, in seconds. Smaller rings, larger creeps.
DAMPING_TIME = 0.03
# Strongest force of the spring, in newtons at the tip; a strong finger presses with 27 N in all.
POSTURE_STRENGTH = 10.0
# Inertia of tendon and muscle at each hinge in kg m^2; it keeps the light phalanges stable.
ARMATURE = 1e-5
# Density of the phalanges in kg/m^3, for their inertia; the arm bears their weight.
DENSITY = 1100.0
# Largest difference of radii within a slice of a tapered capsule, in metres; the error is half of it.
TAPER = 0.0005
# Flesh as soft contacts: time constant in seconds, and impedances at first touch and at a depth of FLESH_DEPTH metres.
# A fingertip gives way by 0.3 mm under 5 N, and an initial overlap of 2 mm does not throw the object. Half the time
# constant loses two grasps in fourteen more.
CONTACT_TIME, IMPEDANCES, FLESH_DEPTH = 0.005, (0.9, 0.99), 0.001
# Stiffness of friction over that of the normal force (MuJoCo's impratio); lower values let held objects creep.
FRICTION_STIFFNESS = 20.0
DIRECTIONS = ["+x", "-x", "+y", "-y", "+z", "-z"]


class Fate(enum.Enum):
    """How a run ended; the values are the report's strings."""

    HELD = "held"
    SLIPPED = "slipped"
    TURNED = "turned"


@dataclass
class Outcome:
    """The farthest that the object moved, in metres, and turned, in degrees."""

    fate: Fate
    distance: float
    angle: float

    @property
    def held(self):
        return self.fate is Fate.HELD


@dataclass
class Object:
    """The held object in its own frame: convex pieces in metres, mass in kilograms."""

    pieces: list
    mass: float
    centre_of_mass: np.ndarray
    friction: float
    # The place by which the object hangs in hooked fingers, if it does.
    hangs_by: np.ndarray | None = None


def simulate(obj, hand, contacts, up, axes=np.eye(3), pushes=DIRECTIONS, other=None):
    """Outcomes by name: "gravity" and, if the object survives that, each push.

    `hand` (None for no hand), `contacts` and `up` are in the object's frame; pushes go along the rows of `axes`, in
    either direction. `other` is a second hand with its contacts.
    """
    grips = [(hand, contacts)] if hand else []
    grips += [other] if other else []
    model = mujoco.MjModel.from_xml_string(world(obj, [hand for hand, _ in grips], -GRAVITY * np.asarray(up)))
    data = mujoco.MjData(model)
    for number, grip in enumerate(grips):
        for joint, torque in torques(*grip, number).items():
            data.qfrc_applied[model.joint(joint).dofadr[0]] = torque
    hand_over(model, data)
    outcomes = {"gravity": run(model, data, obj, SETTLING)}
    settled = data.qpos.copy(), data.qvel.copy(), data.qacc_warmstart.copy()
    if outcomes["gravity"].held:
        for name in pushes:
            data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = settled
            sign, axis = (1 if name[0] == "+" else -1), "xyz".index(name[1])
            data.xfrc_applied[model.body("object").id, :3] = sign * PUSH * obj.mass * axes[axis]
            outcomes[name] = run(model, data, obj, PUSHING)
    return outcomes


def hand_over(model, data):
    """Lets the digits settle while the giver holds the object, then fixes the posture and releases the object."""
    hinges = model.jnt_qposadr[model.actuator_trnid[:, 0]]
    for _ in range(round(HANDING / STEP)):
        # A spring whose target follows the joint adds nothing.
        data.ctrl[:] = data.qpos[hinges]
        mujoco.mj_step(model, data)
    data.eq_active[:] = 0


def run(model, data, obj, seconds):
    """Steps until the time is over or the object is lost."""
    farthest = widest = 0.0
    held = True
    hangs = obj.hangs_by is not None
    watched, lost_angle = (obj.hangs_by, LOST_SWING) if hangs else (obj.centre_of_mass, LOST_ANGLE)
    for _ in range(round(seconds / (STEP * STRIDE))):
        mujoco.mj_step(model, data, STRIDE)
        # The body's frame started as the world's, so its pose is the motion.
        place, turn = data.qpos[:3], data.qpos[3:7]
        angle = np.degrees(2 * np.arctan2(np.linalg.norm(turn[1:]), abs(turn[0])))
        moved = np.empty(3)
        mujoco.mju_rotVecQuat(moved, watched, turn)
        distance = np.linalg.norm(place + moved - watched)
        farthest, widest = max(farthest, distance), max(widest, angle)
        # A diverged simulation counts as lost.
        held = farthest <= LOST_DISTANCE and widest <= lost_angle and np.isfinite(distance + angle)
        if not held:
            break
    fate = Fate.HELD if held else Fate.TURNED if farthest <= LOST_DISTANCE else Fate.SLIPPED
    return Outcome(fate, float(farthest), float(widest))


def torques(hand, contacts, number=0):
    """The constant torque of each hinge of the hand with this number in newton metres, by the hinge's name.

    It is the transposed Jacobian of the contacts beyond the hinge times the forces with which they press on the object.
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
            result[f"{number} {DIGITS[digit]} {PHALANGES[phalanx]}"] = total
    return result


def hinge_axes(hand, chain):
    """The axes of a digit's three pitches."""
    return [(hand.rotations[joint] * HALF_TURN).apply([1.0, 0.0, 0.0]) for joint in chain[:3]]


def world(obj, hands, gravity):
    """The scene in MuJoCo's format. No body is rotated against the world, so offsets are differences of positions."""
    friction = f"{obj.friction:.6g} {obj.friction * TORSION_RADIUS:.6g} 0.0001"
    low, high = IMPEDANCES
    held = "".join(
        f'<geom name="piece {i}" type="mesh" mesh="piece {i}" class="object"/>' for i in range(len(obj.pieces))
    )
    inertia = obj.mass * unit_inertia(obj.pieces)
    entries = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    bodies, servos = ("".join(parts) for parts in zip(("", ""), *map(hand_bodies, hands, range(len(hands)))))
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
                for i, p in enumerate(obj.pieces))}</asset>
<worldbody>
  <body name="object"><freejoint/>
    <inertial pos="{numbers(obj.centre_of_mass)}" mass="{obj.mass}" fullinertia="{numbers(entries)}"/>
    {held}
  </body>
  {bodies}
</worldbody>
<equality><weld name="giver" body1="object" solref="{STEP * 2.5} 1"/></equality>
<actuator>{servos}</actuator>
</mujoco>"""


def hand_bodies(hand, number):
    """A numbered hand: the fixed palm and the digits' chains of phalanges, and the springs that hold their posture."""
    capsules, tags = hand.solids()
    palm = "".join(slices(capsules, row, np.zeros(3)) for row in np.flatnonzero(tags[:, 0] < 0))
    text, servos = [f'<body name="{number} palm">{palm}</body>'], []
    for digit, chain in enumerate(CHAINS):
        places, axes = hand.positions[chain], hinge_axes(hand, chain)
        for phalanx in range(3):
            name = f"{number} {DIGITS[digit]} {PHALANGES[phalanx]}"
            offset = places[phalanx] - (places[phalanx - 1] if phalanx else 0.0)
            row = int(np.flatnonzero((tags == (digit, phalanx)).all(axis=1))[0])
            # The length beyond the hinge; each of the three joints gives way by a third.
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
    """A tapered capsule as capsules of constant radius, relative to `origin`."""
    start, end = capsules.starts[row] - origin, capsules.ends[row] - origin
    r, q = capsules.start_radii[row], capsules.end_radii[row]
    # At least two, so that an untapered one rests on a plane with two contacts.
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
    """The values as the text of an attribute."""
    return " ".join(f"{value:.9g}" for value in values)


ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = ROOT / "target/quality/convex"
# How far a piece may span a hollow by CoACD's measure: a share of the thinnest side of the object's box, and its bounds
# in metres. Pieces bulge less than that (at 1.2 to 2 mm, by 0.5 to 0.9 mm at the 99th percentile); half takes ten times
# as long.
CONCAVITY, FINEST, COARSEST = 0.07, 0.001, 0.002
# Cells along the longest side when CoACD has to make a mesh watertight; detail finer than a cell is lost.
RESOLUTION = 100
# Nodes and rounds of the tree search; CoACD's defaults, 20 and 150, take several times as long for pieces no better.
NODES, ROUNDS = 10, 20


def pieces(mesh):
    """The corners of each convex piece, an (n, 3) array in metres in the mesh's frame."""
    concavity = float(np.clip(CONCAVITY * (mesh.high - mesh.low).min(), FINEST, COARSEST))
    key = hashlib.sha256(repr((concavity, RESOLUTION, NODES, ROUNDS)).encode())
    key.update(np.ascontiguousarray(mesh.vertices, np.float64).tobytes())
    key.update(np.ascontiguousarray(mesh.faces, np.int64).tobytes())
    file = FOLDER / f"{key.hexdigest()[:32]}.npz"
    if not file.exists():
        parts = [part for shell in shells(mesh) for part in decomposed(*shell, concavity)]
        FOLDER.mkdir(parents=True, exist_ok=True)
        # Written under another name and renamed, because other processes may be reading the folder.
        with tempfile.NamedTemporaryFile(dir=FOLDER, suffix=".npz", delete=False) as unfinished:
            np.savez_compressed(unfinished, *parts)
        os.replace(unfinished.name, file)
    with np.load(file) as stored:
        return [stored[name] for name in stored.files]


def shells(mesh):
    """Vertices and faces of each connected part of the surface. Parts may overlap; each is simpler than the whole."""
    points, merged = np.unique(np.round(mesh.vertices, 7), axis=0, return_inverse=True)
    faces = merged.ravel()[mesh.faces]
    links = coo_array((np.ones(2 * len(faces)), (faces[:, :2].ravel(), faces[:, 1:].ravel())), 2 * [len(points)])
    _, labels = connected_components(links, directed=False)
    for label in np.unique(labels[faces[:, 0]]):
        own = faces[labels[faces[:, 0]] == label]
        used, renumbered = np.unique(own, return_inverse=True)
        yield points[used], renumbered.reshape(-1, 3)


def decomposed(vertices, faces, concavity):
    """The convex pieces of one shell: the shell itself if it spans no hollow, else CoACD's pieces."""
    try:
        planes = ConvexHull(vertices).equations
    except QhullError:
        # A flat shell encloses no volume.
        return []
    middles = np.concatenate([vertices, vertices[faces].mean(axis=1)])
    if (middles @ planes[:, :3].T + planes[:, 3]).max(axis=1).min() > -concavity:
        return [vertices]
    coacd.set_log_level("error")
    parts = coacd.run_coacd(
        coacd.Mesh(vertices, faces),
        threshold=concavity,
        real_metric=True,
        preprocess_resolution=RESOLUTION,
        mcts_nodes=NODES,
        mcts_iterations=ROUNDS,
        seed=1,
    )
    return [corners for corners, _ in parts]


def unit_inertia(parts):
    """The inertia tensor, in square metres, of one kilogram spread evenly over the pieces, about their common centre.

    Sums tetrahedra between a piece's faces and its middle. Over a tetrahedron with corners a, b, c, d, the integral of
    x x^T is volume / 20 (sum of the corners' x x^T + the outer product of the corners' sum).
    """
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for corners in parts:
        hull = ConvexHull(corners)
        middle = corners.mean(axis=0)
        for a, b, c in corners[hull.simplices]:
            size = abs(np.linalg.det([a - middle, b - middle, c - middle])) / 6
            tetrahedron = np.array([a, b, c, middle])
            total = tetrahedron.sum(axis=0)
            volume += size
            first += size * total / 4
            second += size / 20 * (tetrahedron.T @ tetrahedron + np.outer(total, total))
    centre = first / volume
    second = second / volume - np.outer(centre, centre)
    return np.trace(second) * np.eye(3) - second
