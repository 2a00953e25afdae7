"""Binary glTF files."""

import json
import struct


def packed(document, data):
    """The file of a glTF document and its one buffer."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def unpacked(file):
    """The glTF document of a file, and its buffer."""
    (length,) = struct.unpack_from("<I", file, 12)
    return json.loads(file[20 : 20 + length]), file[28 + length :]


def scaled(file, factor):
    """The file with everything in it `factor` times as large."""
    document, data = unpacked(file)
    scene = document["scenes"][document.get("scene", 0)]
    document["nodes"].append({"name": "scaled", "children": scene["nodes"], "scale": [factor] * 3})
    scene["nodes"] = [len(document["nodes"]) - 1]
    return packed(document, data)


def triangles(points, corners):
    """The file of one mesh, whose triangles keep their order: float32 and uint32 arrays of three columns."""
    return packed(
        {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "object"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {
                    "bufferView": 0,
                    "componentType": 5126,
                    "count": len(points),
                    "type": "VEC3",
                    "min": points.min(axis=0).tolist(),
                    "max": points.max(axis=0).tolist(),
                },
                {"bufferView": 1, "componentType": 5125, "count": corners.size, "type": "SCALAR"},
            ],
            "bufferViews": [
                {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes},
                {"buffer": 0, "byteOffset": points.nbytes, "byteLength": corners.nbytes},
            ],
            "buffers": [{"byteLength": points.nbytes + corners.nbytes}],
        },
        points.tobytes() + corners.tobytes(),
    )
