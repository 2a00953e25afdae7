"""Grasps for a whole folder of meshes."""

import json
import pathlib
import tomllib

from . import isaac, objects
from .connect import GraspError

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
_VECTORS = ("center_of_mass", "position", "point", "normal", "half_extents")


def meshes(folder):
    """The mesh files of a folder that the server reads, by name."""
    return sorted(file for file in pathlib.Path(folder).iterdir() if file.suffix.lower() in SUFFIXES)


def bake(client, folder, defaults, request, alternatives=1, formats=("json", "isaac")):
    """Creates an object of each mesh, and writes its grasps beside it: NAME.grasps.json as {"object", "grasps"}, and
    NAME.grasps.left.yaml and NAME.grasps.right.yaml as isaac_grasp. Yields (file, number of grasps, reason why there are none)
    as it goes.

    NAME.toml beside a mesh has fields of its object, as for `grasp bake`; `defaults` are those of the others. `request` has
    receiver, requirements and search of FindGrasp.
    """
    for file in meshes(folder):
        try:
            wanted = {"name": objects.object_name(file.stem), **defaults, **sidecar(file.with_suffix(".toml"))}
            present = objects.ensure(client, wanted, file.read_bytes())
            grasps, reason = find(client, {**request, "holdout": {"object": present["name"]}}, alternatives)
            if grasps:
                stem = str(file.with_suffix(".grasps"))
                if "json" in formats:
                    content = json.dumps({"object": present["name"], "grasps": grasps}, indent=1)
                    pathlib.Path(stem + ".json").write_text(content + "\n")
                for side, content in isaac.files(present, grasps).items() if "isaac" in formats else ():
                    pathlib.Path(f"{stem}.{side}.yaml").write_text(content)
            yield file, len(grasps), reason
        except (GraspError, OSError, ValueError, TypeError) as error:
            if isinstance(error, GraspError) and error.code == "unavailable":
                raise
            yield file, 0, str(error)


def find(client, request, alternatives=1):
    """The grasp found, or the best `alternatives` that differ by side and type; and the reason why there are none, in words.
    All have key frames if the way is free."""
    request = {**request, "output": {**request.get("output", {}), "keyFrames": True}}
    if alternatives > 1:
        differing = {"count": alternatives, "differBy": ["DIFFER_BY_APPROACH", "DIFFER_BY_TYPE"]}
        answers = list(client.stream("GraspService/StreamGrasps", {**request, "alternatives": differing}))
    else:
        answers = [client.call("GraspService/FindGrasp", request)]
    grasps = [grasp for answer in answers for grasp in answer.get("grasps", ())]
    report = answers[-1].get("report", {}) if answers else {}
    limits = [limit["description"] for limit in report.get("limits", ())]
    nearest = report.get("nearestMiss", {}).get("verdict", {}).get("description")
    reason = "; ".join(limits) or (f"The nearest attempt failed: {nearest}" if nearest else "No grasp found in time")
    return grasps, "" if grasps else reason


def sidecar(file):
    """The fields of a GraspObject in NAME.toml, or none: points and quaternions are lists there, words have no prefix."""
    return _message(tomllib.loads(file.read_text())) if file.exists() else {}


def _message(value, key=""):
    if isinstance(value, dict):
        return {_camel(name): _message(part, name) for name, part in value.items()} if key != "labels" else value
    if key in _VECTORS:
        return dict(zip("xyz", value, strict=True))
    if key == "orientation":
        return dict(zip("xyzw", value, strict=True))
    if key == "points":
        return [dict(zip("xyz", point, strict=True)) for point in value]
    if isinstance(value, list):
        return [_message(part) for part in value]
    if key in ("preference", "handedness"):
        return f"{key.upper()}_{value.upper()}"
    return value


def _camel(name):
    first, *others = name.split("_")
    return first + "".join(word.capitalize() for word in others)
