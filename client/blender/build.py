#!/usr/bin/env python3
"""Builds the extension for Blender: `python3 client/blender/build.py target/grasp-blender.zip`."""

import pathlib
import sys
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]


def files():
    """Every file, with its name in the extension: the add-on, the built-in hands and the licenses."""
    for file in sorted((HERE / "grasp_blender").iterdir()):
        if file.suffix in (".py", ".toml"):
            yield file, file.name
    for file in sorted((ROOT / "assets/hands").glob("*.glb")):
        yield file, f"hands/{file.name}"
    for file in sorted(ROOT.glob("LICENSE-*")):
        yield file, file.name


if __name__ == "__main__":
    target = pathlib.Path(sys.argv[1])
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, name in files():
            archive.write(file, name)
    print(target)
