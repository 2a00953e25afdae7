"""Compiles the Unreal plugin with the part of Unreal that it uses (tests/foreign/unreal/Unreal.h), and runs it: its headers on the
golden grasps and in a client by libgrpc++, its component against a server. The code of the contract is compiled once."""

import hashlib
import json
import re
import shutil
import subprocess

import pytest

from conftest import ROOT

PLUGIN = ROOT / "client/unreal"
SOURCE = PLUGIN / "Source/Grasp"
TESTS = ROOT / "tests/foreign/unreal"
WORK = ROOT / "target/foreign/unreal"
README = (PLUGIN / "README.md").read_text()
# All files of the contract that the tests use, each after those that it imports.
PROTOS = ["google/api/field_behavior", "google/api/resource"]
PROTOS += [f"grasp/v1/{name}" for name in ("grasp_type", "holdout", "grasp", "search", "track", "hand_rig_service", "grasp_service")]


def compiled(output, sources, depends, *options):
    """Compiles sources, unless the output was made of these very files."""
    digest = hashlib.sha256(repr(options).encode())
    for file in sorted({*sources, *depends}):
        digest.update(file.read_bytes())
    state = output.with_suffix(".sha256")
    if not output.exists() or not state.exists() or state.read_text() != digest.hexdigest():
        command = ["g++", "-std=c++17", "-o", output, *sources, *options]
        run = subprocess.run(command, capture_output=True, text=True, timeout=540)
        assert run.returncode == 0, run.stdout + run.stderr
        state.write_text(digest.hexdigest())
    return output


@pytest.fixture(scope="module")
def contract():
    """The contract's code as one object file."""
    if not all(shutil.which(tool) for tool in ("g++", "protoc", "grpc_cpp_plugin", "pkg-config")):
        pytest.skip("g++ and gRPC for C++ are not installed")
    WORK.mkdir(parents=True, exist_ok=True)
    plugin = f"--plugin=protoc-gen-grpc={shutil.which('grpc_cpp_plugin')}"
    files = [f"{name}.proto" for name in PROTOS]
    subprocess.run(["protoc", "-Iproto", f"--cpp_out={WORK}", f"--grpc_out={WORK}", plugin, *files], cwd=ROOT, check=True, timeout=60)
    # One file is compiled in a sixth of the time; names that every generated file has are told apart.
    text = ""
    for number, name in enumerate(PROTOS):
        for own in ("schemas", "file_default_instances"):
            text += f"#undef {own}\n#define {own} {own}_{number}\n"
        text += f'#include "{name}.pb.cc"\n'
    whole = WORK / "contract.cpp"
    whole.write_text(text + '#include "grasp/v1/grasp_service.grpc.pb.cc"\n')
    depends = [file for file in WORK.glob("g*/**/*") if file.is_file()]
    return compiled(WORK / "contract.o", [whole], depends, "-c", f"-I{WORK}")


def run_tests(name, sources, contract, *arguments):
    """Builds a program and runs it: every test that its source names passes."""
    source = TESTS / f"{name}.cpp"
    libraries = subprocess.run(
        ["pkg-config", "--libs", "grpc++", "protobuf"], capture_output=True, text=True, check=True, timeout=20
    ).stdout.split()
    includes = [f"-I{folder}" for folder in (WORK, WORK / "engine", TESTS, SOURCE / "Public", SOURCE / "Private")]
    depends = [*TESTS.iterdir(), *SOURCE.glob("*/*"), WORK / "contract.sha256", *WORK.glob("engine/FirstCall.h")]
    program = compiled(
        WORK / name, [source, *sources, contract], depends, "-Wall", "-Wextra", "-Werror", *includes, *libraries
    )
    run = subprocess.run([program, ROOT / "proto/golden/grasps.json", *arguments], capture_output=True, text=True, timeout=120)
    print(run.stdout)
    assert run.returncode == 0, run.stdout + run.stderr
    named = re.findall(r'Run\("(\w+)"', source.read_text())
    assert named and re.findall(r"^passed (\w+)$", run.stdout, flags=re.MULTILINE) == named


def test_the_headers_and_a_client_by_grpc(contract, address):
    run_tests("client", [], contract, address)


def test_the_component(contract, address):
    sources = sorted(SOURCE.glob("Private/*.cpp"))
    [first_call] = re.findall(r"^```cpp\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)
    assert len(first_call.splitlines()) <= 25
    # Every header of the engine is Unreal.h.
    engine = WORK / "engine"
    shutil.rmtree(engine, ignore_errors=True)
    texts = [file.read_text() for file in [*SOURCE.glob("*/*"), TESTS / "component.cpp"]]
    for header in re.findall(r'^#include "([^"]+)"', "\n".join([*texts, first_call]), flags=re.MULTILINE):
        if not any((folder / header).exists() for folder in (SOURCE / "Public", SOURCE / "Private", TESTS)):
            (engine / header).parent.mkdir(parents=True, exist_ok=True)
            (engine / header).write_text('#include "Unreal.h"\n')
    (engine / "FirstCall.h").write_text(first_call)
    run_tests("component", sources, contract, f"http://{address}")


def test_the_readme_lists_the_importers():
    rows = re.findall(r"^\| (.+?) \| \((.*?)\) \| `(\w+)` \| `(\w+)` \| (.*?) ?\|$", README, flags=re.MULTILINE)
    importers = [row for row in json.loads((ROOT / "client/importers.json").read_text()) if row["engine"] == "Unreal"]
    names = {"UNREAL": "GltfRuntime", "UNREAL_XZY": "XZY"}
    # Roll is the other way round than the quaternion's angle about x.
    turns = {None: "", (0, 0, 1, 0): "Yaw 180", (-0.70710678, 0, 0, 0.70710678): "Roll 90"}
    expected = []
    for row in importers:
        convention = row["convention"].removeprefix("CONVENTION_")
        turn = turns[tuple(row["turn"]) if "turn" in row else None]
        expected.append((row["importer"], ", ".join(row["axes"]), names[convention], convention, turn))
    assert rows == expected
