"""Compiles the Unity package with Mono and the parts of Unity, Google.Protobuf and gRPC that it uses (tests/foreign/unity), and runs
it: on the golden vectors, and its receiver against a server. Messages come from the README's commands. gRPC only compiles."""

import json
import re
import shutil
import subprocess

import pytest

from conftest import ROOT

PACKAGE = ROOT / "client/unity"
STUBS = ROOT / "tests/foreign/unity"
WORK = ROOT / "target/foreign/unity"
README = (PACKAGE / "README.md").read_text()
# As C# before 7: Mono's compiler knows no later one, and Unity 2021.3 compiles it too.
MCS = ["mcs", "-langversion:6", "-r:System.Net.Http"]


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


def compiled(output, sources, *options):
    kind = "exe" if output.suffix == ".exe" else "library"
    run = subprocess.run(
        [*MCS, f"-target:{kind}", f"-out:{output}", *options, *sources], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return output


@pytest.fixture(scope="module")
def stubs():
    """A library with all that the package uses, and the generated messages."""
    if not shutil.which("mcs") or not shutil.which("protoc"):
        pytest.skip("Mono and protoc are not installed")
    WORK.mkdir(parents=True, exist_ok=True)
    generated = WORK / "Generated"
    shutil.rmtree(generated, ignore_errors=True)
    [commands] = blocks("sh")
    commands = commands.replace("client/unity/Runtime/Generated", str(generated))
    subprocess.run(["bash", "-e", "-c", commands], cwd=ROOT, check=True, timeout=60)
    sources = [STUBS / name for name in ("Json.cs", "Protobuf.cs", "UnityEngine.cs", "Grpc.cs")]
    sources += generated.glob("*.cs")
    # Leaves out spans, which mcs cannot compile.
    return compiled(WORK / "Stubs.dll", sources, "-define:GOOGLE_PROTOBUF_REFSTRUCT_COMPATIBILITY_MODE", "-nowarn:0612,0414")


def runtime():
    return sorted((PACKAGE / "Runtime").glob("*.cs"))


@pytest.mark.parametrize(
    "defines",
    [
        "UNITY_2021_3_OR_NEWER",
        "GRASP_GRPC;GRASP_YETANOTHERHTTPHANDLER;GRASP_XR_HANDS",
        "GRASP_GRPC;UNITY_6000_5_OR_NEWER",
        "GRASP_GRPC;GRASP_YETANOTHERHTTPHANDLER;UNITY_6000_5_OR_NEWER",
        "GRASP_GRPC;GRASP_YETANOTHERHTTPHANDLER;UNITY_WEBGL",
    ],
)
def test_the_package_compiles(stubs, defines):
    sources = runtime() + list(PACKAGE.glob("Samples~/*/*.cs"))
    # 162: behind the return of one transport is that of another.
    compiled(WORK / "Grasp.dll", sources, f"-define:{defines}", f"-r:{stubs}", "-warnaserror", "-nowarn:0162")


def test_the_package_runs(stubs, address):
    first_call = WORK / "FirstCall.cs"
    assert len(blocks("csharp")[0].splitlines()) <= 25
    first_call.write_text(blocks("csharp")[0].replace("127.0.0.1:50051", address))
    tests = compiled(WORK / "Tests.exe", [STUBS / "Tests.cs", first_call, *runtime()], "-define:GRASP_XR_HANDS", f"-r:{stubs}")
    run = subprocess.run(
        ["mono", tests, ROOT / "proto/golden/grasps.json", f"http://{address}"], capture_output=True, text=True, timeout=120
    )
    print(run.stdout)
    assert run.returncode == 0, run.stdout + run.stderr
    named = set(re.findall(r"static void (Test\w+)", (STUBS / "Tests.cs").read_text()))
    assert set(re.findall(r"^passed (\w+)$", run.stdout, flags=re.MULTILINE)) == named


def test_the_readme_lists_the_importers():
    rows = re.findall(r"^\| (.+?) \| \((.*?)\) \| `(\w+)` \| `(\w+)` \|$", README, flags=re.MULTILINE)
    names = {"CONVENTION_UNITY": ("FlipsZ", "Unity"), "CONVENTION_UNITY_FLIP_X": ("FlipsX", "UnityFlipX")}
    importers = json.loads((ROOT / "client/importers.json").read_text())
    assert rows == [
        (row["importer"], ", ".join(row["axes"]), *names[row["convention"]]) for row in importers if row["engine"] == "Unity"
    ]
