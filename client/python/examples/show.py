"""Shows handovers in a browser: the object, the giver's hand, and the receiving hand with its contacts and forces.

    python client/python/examples/show.py localhost:50051

Needs `pip install trimesh viser`, and the checkout for its requests and skins of hands. `--once` builds the scene and exits.
"""

import argparse
import io
import json
import struct
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import trimesh
import viser
from google.protobuf import json_format

import grasp
from grasp import v1

ROOT = Path(__file__).resolve().parents[3]
#: Colors of the giver's and the receiving hand, contacts and forces.
GIVER, RECEIVER, CONTACT, FORCE = (208, 146, 116), (122, 168, 120), (220, 60, 40), (240, 180, 40)
#: Whose hand takes it.
SIDES: dict[str, Literal["left", "right"] | None] = {"better": None, "left": "left", "right": "right"}
#: Length of the arrow of the largest force, in meters.
LONGEST_ARROW = 0.05

Array = npt.NDArray[Any]


class Skin:
    """The skin of a built-in hand."""

    def __init__(self, hand: str) -> None:
        data = (ROOT / "assets/hands" / f"{hand}.glb").read_bytes()
        (json_bytes,) = struct.unpack_from("<I", data, 12)
        self._gltf = json.loads(data[20 : 20 + json_bytes])
        self._binary = data[20 + json_bytes + 8 :]
        (primitive,) = self._gltf["meshes"][0]["primitives"]
        attributes = primitive["attributes"]
        self.faces = self._read(primitive["indices"]).reshape(-1, 3)
        self._vertices = self._read(attributes["POSITION"])
        self._bones, self._weights = self._read(attributes["JOINTS_0"]), self._read(attributes["WEIGHTS_0"])
        # glTF's matrices are stored by columns.
        self._bone_from_mesh = self._read(self._gltf["skins"][0]["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)

    def posed(self, joints: grasp.Joints, scale: float) -> Array:
        """The vertices for a hand's joints, of which the skin follows all but the palm."""
        resized = np.diag([scale, scale, scale, 1])
        moved = joints.poses[1:] @ resized @ self._bone_from_mesh
        each = np.einsum("vwij,vj->vwi", moved[self._bones], np.insert(self._vertices, 3, 1, axis=1))
        posed: Array = np.einsum("vw,vwi->vi", self._weights, each[..., :3])
        return posed

    def _read(self, accessor: int) -> Array:
        described = self._gltf["accessors"][accessor]
        kind = {5121: np.uint8, 5123: np.uint16, 5126: np.float32}[described["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[described["type"]]
        start = self._gltf["bufferViews"][described["bufferView"]]["byteOffset"]
        values = np.frombuffer(self._binary, kind, described["count"] * width, start)
        return values.reshape(-1, width)


class Show:
    """The page: controls, and the scene of the chosen handover."""

    def __init__(self, client: grasp.Client, port: int) -> None:
        self.client = client
        golden = json.loads((ROOT / "proto/golden/grasps.json").read_text())
        self.requests = {
            vector["name"]: json_format.ParseDict(vector["conventions"][0]["request"], v1.FindGraspRequest())
            for vector in golden["vectors"]
        }
        self.server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
        scene = self.server.scene
        scene.set_up_direction("+y")
        scene.configure_environment_map(None)
        scene.configure_default_lights(cast_shadow=False)
        scene.add_light_hemisphere("/light", sky_color=(255, 255, 255), ground_color=(150, 140, 130), intensity=2.5)
        self.server.initial_camera.position = (-0.22, 0.24, 0.32)
        self.server.initial_camera.look_at = (0.0, 0.0, 0.0)

        gui = self.server.gui
        self.giver = gui.add_dropdown("Giver", list(self.requests))
        self.side = gui.add_dropdown("Receiver", list(SIDES))
        self.stage = gui.add_dropdown("Stage", ["approach", "pre_grasp", "close"], initial_value="close")
        self.report = gui.add_markdown("")
        for control in (self.giver, self.side, self.stage):
            control.on_update(lambda _: self.draw())
        self.draw()

    def draw(self) -> None:
        """Asks for a grasp and shows it."""
        request = self.requests[self.giver.value]
        holdout = request.holdout
        giver = holdout.presenting_hand.pose
        result = self.client.find(
            holdout.object,
            client_from_object=holdout.client_from_object,
            presenting_hand=giver,
            receiver=SIDES[self.side.value],
            budget=0.5,
            choice="best_within_budget",
            key_frames=True,
        )
        with self.server.atomic():
            self.draw_object(holdout)
            self.draw_hand("/giver", giver, GIVER, 1.0)
            self.draw_contacts(grasp.matrix(holdout.client_from_object), result.grasp)
            if result.grasp:
                message = result.grasp.message
                stages = {v1.KeyFrameKind.Name(frame.kind): frame.hand for frame in message.key_frames}
                stage = f"KEY_FRAME_KIND_{self.stage.value.upper()}"
                self.draw_hand("/receiver", stages.get(stage, message.hand), RECEIVER, 0.7)
                self.report.content = f"**{result.grasp.type}**, score {message.score:.2f}"
            else:
                self.server.scene.remove_by_name("/receiver")
                self.report.content = f"{result.outcome}: {result.message.report.attempts} attempts"

    def draw_object(self, holdout: v1.Holdout) -> None:
        """The mesh that searches use; forbidden surfaces are red."""
        pose = holdout.client_from_object
        q, position = pose.orientation, pose.position
        loaded = trimesh.load_scene(io.BytesIO(self.client.objects.mesh(holdout.object)), file_type="glb")
        self.server.scene.remove_by_name("/object")
        for name, mesh in loaded.geometry.items():
            assert isinstance(mesh, trimesh.Trimesh)
            material = getattr(mesh.visual, "material", None)
            forbidden = getattr(material, "name", "") == "forbidden"
            self.server.scene.add_mesh_simple(
                f"/object/{name}",
                mesh.vertices,
                mesh.faces,
                color=(190, 70, 60) if forbidden else (120, 140, 175),
                flat_shading=True,
                side="double",
                wxyz=(q.w, q.x, q.y, q.z),
                position=(position.x, position.y, position.z),
            )

    def draw_hand(self, name: str, hand: v1.HandPose, color: tuple[int, int, int], opacity: float) -> None:
        """A posed hand with its rig's skin."""
        joints = grasp.hand_joints(self.client.rigs.get(hand.rig), hand)
        skin = Skin(f"{hand.rig.removeprefix('rigs/')}_{joints.handedness}")
        vertices = skin.posed(joints, hand.scale if hand.HasField("scale") else 1.0)
        self.server.scene.add_mesh_simple(name, vertices, skin.faces, color=color, opacity=opacity)

    def draw_contacts(self, client_from_object: Array, found: grasp.Grasp | None) -> None:
        """A ball per contact, and an arrow along each force, from outside to the surface."""
        self.server.scene.remove_by_name("/contacts")
        if found is None or self.stage.value != "close":
            return
        turn = client_from_object[:3, :3].T
        points = found.contact_positions @ turn + client_from_object[:3, 3]
        forces = found.contact_forces @ turn
        longest = np.linalg.norm(forces, axis=1).max(initial=1e-9)
        for row, point in enumerate(points):
            self.server.scene.add_icosphere(f"/contacts/{row}", radius=0.003, color=CONTACT, position=point)
        ends = np.stack([points - forces / longest * LONGEST_ARROW, points], 1)
        self.server.scene.add_arrows(
            "/contacts/forces", ends, FORCE, shaft_radius=0.0015, head_radius=0.004, head_length=0.01
        )


def main() -> None:
    parser = argparse.ArgumentParser(description="Shows handovers in a browser.")
    parser.add_argument("target", nargs="?", default="localhost:50051", help="host:port of a Grasp server")
    parser.add_argument("--port", type=int, default=8080, help="port of the page")
    parser.add_argument("--once", action="store_true", help="build the scene and exit")
    arguments = parser.parse_args()
    with grasp.Client(arguments.target) as client:
        show = Show(client, arguments.port)
        print(f"{show.report.content} on http://localhost:{show.server.get_port()}", flush=True)
        if not arguments.once:
            show.server.sleep_forever()
        show.server.stop()


if __name__ == "__main__":
    main()
