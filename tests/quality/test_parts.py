"""Labelled handles, sharp features found in meshes, and power, on shapes of closed form and on the everyday objects."""

import numpy as np
import pytest

import hand as hands
import holdouts
import measures
import parts
import taxonomy
from grip import palm_axes, Shape
from hand import DIGITS, Hand, PHALANGES
from solids import Mesh
from test_geometry import box, BOX_FACES
from test_judge import faults, good, judged, PINCH, pinching_hand, touching_balls


def wedge(angle, height=0.03, length=0.06, inside_out=False):
    """A prism of triangular section, whose edge of `angle` degrees lies along x."""
    half = height * np.tan(np.radians(angle / 2))
    section = np.array([[0, 0], [height, half], [height, -half]])
    vertices = [[x, *point] for x in (0.0, length) for point in section]
    faces = [[0, 2, 1], [3, 4, 5]]
    for i in range(3):
        j = (i + 1) % 3
        faces += [[i, j, 3 + j], [i, 3 + j, 3 + i]]
    mesh = Mesh(vertices, np.array(faces)[:, ::-1] if inside_out else faces)
    return mesh


def blunt_wedge(end, back, height=0.03, length=0.06):
    """A blade of trapezoid section: thin at z = 0, thicker at z = height."""
    section = [[-end / 2, 0], [end / 2, 0], [back / 2, height], [-back / 2, height]]
    vertices = [[x, *point] for x in (0.0, length) for point in section]
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    for i in range(4):
        j = (i + 1) % 4
        faces += [[i, j, 4 + j], [i, 4 + j, 4 + i]]
    return Mesh(vertices, faces)


def cone(half_angle, height=0.02, sides=24):
    """A cone with its tip at the origin."""
    turn = 2 * np.pi * np.arange(sides) / sides
    radius = height * np.tan(np.radians(half_angle))
    base = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(sides, height)], axis=1)
    vertices = np.concatenate([[[0, 0, 0]], base, [[0, 0, height]]])
    faces = [[0, 1 + (i + 1) % sides, 1 + i] for i in range(sides)]
    faces += [[sides + 1, 1 + i, 1 + (i + 1) % sides] for i in range(sides)]
    return Mesh(vertices, faces)


class TestSharpFeatures:
    @pytest.mark.parametrize("inside_out", [False, True])
    def test_a_thin_wedge_has_a_sharp_edge(self, inside_out):
        edges = parts.sharp_edges(wedge(20, inside_out=inside_out))
        assert np.allclose(np.abs(edges[:, :, 1:]).max(), 0)
        assert np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).sum() == pytest.approx(0.06)

    def test_thick_wedges_and_short_edges_do_not_cut(self):
        assert len(parts.sharp_edges(wedge(40))) == 0
        assert len(parts.sharp_edges(wedge(20, length=0.008))) == 0

    def test_a_blade_with_a_worn_edge_cuts_and_a_card_does_not(self):
        found = parts.worn_edges(blunt_wedge(0.0006, 0.005))
        # At the heel the blade is thin as well.
        middle = found[(found[:, 0] > 0.01) & (found[:, 0] < 0.05)]
        assert len(middle) and middle[:, 2].max() < 0.002 and found[:, 2].max() < 0.01
        assert len(parts.worn_edges(blunt_wedge(0.0008, 0.0008))) == 0

    def test_boxes_balls_and_cylinders_have_nothing_sharp(self):
        for mesh in (
            Mesh(box([0.03, 0.02, 0.01]), BOX_FACES),
            ball(0.02, np.zeros(3)),
            cylinder(0.01, 0.1, np.eye(3), np.zeros(3)),
        ):
            assert len(parts.sharp_features(mesh)) == 0

    def test_a_slender_cone_has_a_tip_and_a_wide_one_has_none(self):
        assert np.allclose(parts.tips(cone(10)), 0)
        assert len(parts.tips(cone(10))) == 1
        assert len(parts.tips(cone(35))) == 0

    def test_contacts_on_a_blade_count_where_the_object_offers_more(self):
        scene, _, _ = good()
        scene.mesh, scene.forbidden = wedge(20, height=0.05, length=0.1), np.empty(0, int)
        spots = np.array([[0.05, 0.001, 0.0], [0.05, 0.04, 0.007]])
        found = parts.sharpness(scene, spots, None)
        assert found == {"sharp_contacts": 1, "has_sharp": True, "offers_elsewhere": True}
        scene.mesh = wedge(20, height=0.02, length=0.03)
        assert not parts.sharpness(scene, spots, None)["offers_elsewhere"]


@pytest.fixture(scope="module")
def files():
    """Writes the files of the everyday objects."""
    if not holdouts.PROGRAM.exists():
        pytest.skip("needs the release binary grasp-everyday")
    holdouts.things()


class TestHandles:
    # Shares of the surface, to tell a handle from the rest of the thing.
    @pytest.mark.parametrize(
        ("name", "low", "high"),
        [("mug", 0.04, 0.12), ("pan", 0.05, 0.15), ("hammer", 0.5, 0.75), ("drill", 0.1, 0.25), ("dumbbell", 0.1, 0.4)],
    )
    def test_labels_cover_the_expected_share(self, files, name, low, high):
        mesh = holdouts.load_mesh(name)
        assert low < len(parts.handle_samples(name, mesh)) / len(parts.spread(mesh)) < high

    def test_every_label_names_a_group_of_its_file(self, files):
        for name, groups in parts.BY_GROUP.items():
            text = holdouts.mesh_file(name).read_text()
            for group in groups:
                assert f"\ng {group}\n" in text or f"\no {group}\n" in text, name

    def test_measures_contacts_on_the_handle_and_what_the_giver_leaves(self, files):
        mesh = holdouts.load_mesh("mug")
        handle = parts.handle_samples("mug", mesh)
        cup = np.array([[-0.058, 0.0, 0.0]])
        free = parts.on_handle("mug", mesh, np.concatenate([handle[:3], cup]), None)
        assert free == {"handle_free": 1.0, "on_handle": 0.75}
        giver = hands.posed("adult", "right", [0, 0, 0], [0, 0, 0, 1], [dict.fromkeys(
            ["base_yaw", "base_pitch", "second_pitch"], 0.0)] * 5)  # fmt: skip
        at_handle = giver.moved(giver.rotations[0].identity(), handle.mean(axis=0) - giver.positions[12])
        assert parts.on_handle("mug", mesh, cup, at_handle)["handle_free"] < 0.5
        assert parts.on_handle("can", mesh, cup, None) == {}


def row(**changes):
    """A row of a grasp that meets every target."""
    result = {
        "object": "mug", "type": "medium_wrap", "type_confidence": 0.9, "type_agreed": True, "own_type": "medium_wrap",
        "type_fits_shape": True, "handle_free": 0.8, "on_handle": 1.0, "has_sharp": True, "offers_elsewhere": True,
        "sharp_contacts": 0, "contacts": 5, "mass_kg": 1.4, "palm_or_four": True, "survives_gravity": True,
        "survives_all": True,
    }  # fmt: skip
    return {**result, **changes}


class TestVerdicts:
    def test_all_targets_are_met_by_good_grasps(self):
        lines = taxonomy.targets([row(), row(cold=True)])
        assert len(lines) == 8
        assert all(met for *_, met in lines if met is not None)

    @pytest.mark.parametrize(
        ("measure", "changes"),
        [
            ("type agreed, with an atlas", {"type_confidence": 0.4}),
            ("type agreed, with an atlas", {"type_agreed": False}),
            ("mostly on the handle", {"on_handle": 0.5}),
            ("on sharp edges", {"sharp_contacts": 1}),
            ("above 1 kg", {"palm_or_four": False}),
            ("kept against gravity", {"survives_gravity": False}),
        ],
    )
    def test_each_fault_misses_its_target(self, measure, changes):
        missed = [name for name, _, _, met in taxonomy.targets([row(**changes)]) if met is False]
        assert len(missed) == 1 and measure in missed[0]

    def test_handles_that_the_giver_holds_do_not_count(self):
        assert not any("handle, where" in name for name, *_ in taxonomy.targets([row(handle_free=0.4, on_handle=0.0)]))

    def test_tables_name_objects_types_and_masses(self):
        text = taxonomy.tables([row(), row(type="power_disk", type_agreed=False, type_fits_shape=False)])
        assert "| power disk | 1 | 0 | 0 | medium wrap (1) |" in text
        assert "| mug | 1 of 2 | 2 of 2 | 0 of 10 |" in text
        assert "| 0.8 to 1 | 2 | 0.90 | 50 % |" in text
        assert taxonomy.tables([{"found": True}]) == ""


def test_heavy_things_ask_for_the_palm_or_four_digits():
    scene, grasp, _ = good()
    assert not parts.judge("none", scene, grasp)["palm_or_four"]
    grasp["contacts"].append({**grasp["contacts"][0], "digit": None, "phalanx": None})
    assert parts.judge("none", scene, grasp)["palm_or_four"]
    assert measures.in_object_frame(scene, grasp)[1][-1]["digit"] is None


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
