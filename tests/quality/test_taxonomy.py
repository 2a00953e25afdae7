"""The judge's classifier on hands and objects of closed form."""

import numpy as np
import pytest

import hand as hands
import taxonomy
from grip import palm_axes, Shape
from hand import DIGITS, PHALANGES, Hand
from solids import Mesh
from test_geometry import BOX_FACES, box
from test_judge import PINCH, pinching_hand, touching_balls


def cylinder(radius, length, axes, centre, sides=48):
    """A cylinder along the first of the axes."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.outer(np.cos(turn), axes[1]) + np.outer(np.sin(turn), axes[2])
    ends = [centre + radius * ring + side * length / 2 * axes[0] for side in (-1, 1)]
    # Rows between the ends keep triangles short.
    rows = [ends[0] + share * (ends[1] - ends[0]) for share in np.linspace(0, 1, 9)]
    vertices = np.concatenate([*rows, [ends[0].mean(axis=0), ends[1].mean(axis=0)]])
    faces, after = [], (np.arange(sides) + 1) % sides
    for row in range(8):
        a = row * sides
        faces += [[a + i, a + j, a + sides + i] for i, j in enumerate(after)]
        faces += [[a + j, a + sides + j, a + sides + i] for i, j in enumerate(after)]
    faces += [[len(vertices) - 2, j, i] for i, j in enumerate(after)]
    faces += [[len(vertices) - 1, 8 * sides + i, 8 * sides + j] for i, j in enumerate(after)]
    return Mesh(vertices, faces)


def ball(radius, centre, steps=32):
    """A ball of quads along meridians."""
    up = np.linspace(0, np.pi, steps + 1)
    around = np.linspace(0, 2 * np.pi, 2 * steps, endpoint=False)
    u, v = np.meshgrid(up, around, indexing="ij")
    points = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).reshape(-1, 3)
    faces, n = [], 2 * steps
    for i in range(steps):
        for j in range(n):
            a, b, c, d = i * n + j, i * n + (j + 1) % n, (i + 1) * n + j, (i + 1) * n + (j + 1) % n
            faces += [[a, c, d], [a, d, b]]
    return Mesh(centre + radius * points, faces)


def touches(hand, mesh, within=0.0015):
    """Contacts of all phalanges, and of the palm, that are this near to the surface, each pressing with a newton."""
    capsules, tags = hand.solids()
    points, owners = mesh.samples()
    distances = capsules.distances(points)
    contacts = []
    for row, (digit, phalanx) in enumerate(tags):
        nearest = int(np.argmin(np.abs(distances[:, row])))
        if abs(distances[nearest, row]) < within:
            contacts.append(
                {
                    "position": points[nearest],
                    "normal": mesh.normals[owners[nearest]],
                    "force": -mesh.normals[owners[nearest]],
                    "digit": DIGITS[digit] if digit >= 0 else None,
                    "phalanx": PHALANGES[phalanx] if digit >= 0 else None,
                }
            )
    return contacts


def closed(angles, distance, joints=(1, 2, 3)):
    """The hand whose joints, digit by digit, bend until the phalanx they carry touches, or to 85 degrees.

    `distance` gives the distance of points from a surface.
    """
    angles = np.array(angles, float)

    def gap(digit, phalanx):
        capsules, tags = pinching_hand(angles).solids()
        row = np.flatnonzero((tags == (digit, phalanx)).all(axis=1))
        centres, radii = capsules.subset(row).at(np.linspace(0, 1, 9)[:, None])
        return (distance(centres[:, 0]) - radii[:, 0]).min()

    for digit in range(5):
        for joint in joints:
            while gap(digit, joint - 1) > 0.0003 and angles[digit, joint] < 85:
                angles[digit, joint] += 0.5
    return pinching_hand(angles)


# Fingers straight, the thumb opposite them.
OPEN = [[40, 20, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]


def frame():
    """Palmar, radial and distal directions of the palm of these hands, and the middle of the palm's skin."""
    hand = pinching_hand(OPEN)
    axes = palm_axes(hand)
    return axes, (hand.positions[11] + hand.positions[12]) / 2 + hand.radii[12] * axes[0]


def read(hand, mesh):
    """The judge's reading, and the same of the mirrored hand and object."""
    contacts = touches(hand, mesh)
    reading = taxonomy.classify(mesh, hand, contacts)
    flip = np.array([-1.0, 1.0, 1.0])
    quaternions = hand.rotations.as_quat() * [1, -1, -1, 1]
    mirrored = Hand("left", hand.positions * flip, quaternions, hand.radii, hand.rig)
    turned = [{**c, **{key: c[key] * flip for key in ("position", "normal", "force")}} for c in contacts]
    other = taxonomy.classify(Mesh(mesh.vertices * flip, mesh.faces[:, ::-1]), mirrored, turned)
    return reading, other


def wrap(radius):
    """A hand wrapped around a cylinder that lies across the palm."""
    axes, palm = frame()
    centre = palm + (radius + 0.0005) * axes[0] + 0.012 * axes[2]

    def distance(points):
        offset = points - centre
        return np.linalg.norm(offset - np.outer(offset @ axes[1], axes[1]), axis=1) - radius

    return closed(OPEN, distance), cylinder(radius, 0.2, axes[[1, 2, 0]], centre)


@pytest.mark.parametrize(
    ("radius", "names"),
    [
        (0.011, {"small_diameter", "medium_wrap", "light_tool", "adducted_thumb"}),
        (0.020, {"medium_wrap", "adducted_thumb"}),
        (0.038, {"large_diameter"}),
    ],
)
def test_a_fist_around_a_cylinder_is_a_wrap(radius, names):
    hand, mesh = wrap(radius)
    for reading in read(hand, mesh):
        assert reading.own_type in names, reading
        assert taxonomy.allowed_for_shape("medium_wrap", reading.shape)
        assert not taxonomy.allowed_for_shape("power_sphere", reading.shape)
        assert not taxonomy.allowed_for_shape("power_disk", reading.shape)


def test_a_ball_in_all_digits_is_a_sphere_type():
    axes, palm = frame()
    radius = 0.033
    centre = palm + (radius + 0.001) * axes[0] + 0.025 * axes[2]

    def distance(points):
        return np.linalg.norm(points - centre, axis=1) - radius

    for reading in read(closed(OPEN, distance), ball(radius, centre)):
        assert reading.shape.name == "ball"
        assert {"power_sphere", "precision_sphere"} & reading.acceptable, reading
        assert not taxonomy.allowed_for_shape("medium_wrap", reading.shape)


def test_two_pads_on_a_card_pinch_it():
    hand = pinching_hand(PINCH)
    thumb, index, direction = touching_balls(hand)
    middle = (thumb + index) / 2
    outward = middle - hand.positions[hands.WRIST]
    outward -= outward @ direction * direction
    outward /= np.linalg.norm(outward)
    axes = np.stack([direction, outward, np.cross(direction, outward)])
    half = np.array([np.linalg.norm(index - thumb) / 2, 0.04, 0.025])
    mesh = Mesh(box(half, middle + 0.03 * outward, axes), BOX_FACES)
    for reading in read(hand, mesh):
        assert reading.shape.of("plate", "strip") > 0.5, reading.shape
        assert reading.acceptable <= {"palmar_pinch", "tip_pinch", "lateral", "inferior_pincer", "prismatic_2_finger"}
        assert {"palmar_pinch", "tip_pinch"} & reading.acceptable, reading
        for name in ("power_sphere", "medium_wrap", "power_disk", "sphere_3_finger"):
            assert not taxonomy.allowed_for_shape(name, reading.shape), name


def test_what_hangs_is_in_a_fixed_hook():
    hand, mesh = wrap(0.011)
    assert taxonomy.classify(mesh, hand, touches(hand, mesh), hangs=True).acceptable == {"fixed_hook"}


def test_mirrored_hands_have_the_same_type():
    for radius in (0.011, 0.038):
        reading, other = read(*wrap(radius))
        assert reading.own_type == other.own_type
        assert reading.acceptable == other.acceptable


def test_every_type_is_shown_for_some_shape():
    shown = {number for numbers in taxonomy.BY_SHAPE.values() for number in numbers}
    assert shown == set(taxonomy.NAMES)
    assert {taxonomy.kind_of(name) for name in taxonomy.NAMES.values()} == {"power", "intermediate", "precision"}


def test_a_thin_strip_takes_no_sphere():
    strip = Shape(0.14, 0.010, 0.003, np.array([1.0, 0, 0]), 0.3, 0.003, {"strip": 1.0, "rod": 0.6})
    assert not taxonomy.allowed_for_shape("sphere_3_finger", strip)
    assert taxonomy.allowed_for_shape("writing_tripod", strip)
