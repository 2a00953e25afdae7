"""Clients by others call over the Connect protocol: connect-es in Node, curl, Python without a library, and buf curl."""

import base64
import json
import os
import subprocess
import urllib.error
import urllib.request

import pytest
from conftest import ROOT
from test_web import LONGEST, WORK, bundles, check, check_tracked  # noqa: F401 (a fixture)

FIND = "/grasp.v1.GraspService/FindGrasp"
REMOTE = {"holdout": {"object": "objects/remote"}, "search": {"seed": 1}}


@pytest.fixture(scope="module")
def in_node(address, bundles):  # noqa: F811
    subprocess.run(
        [
            "esbuild",
            ROOT / "tests/foreign/connect/node.mjs",
            "--bundle",
            "--format=esm",
            "--platform=node",
            f"--alias:#contract={bundles / 'es/grasp/v1'}",
            f"--outfile={WORK / 'connect.bundle.mjs'}",
            "--log-level=warning",
        ],
        env={**os.environ, "NODE_PATH": str(WORK / "node_modules")},
        check=True,
        timeout=120,
    )
    run = subprocess.run(
        ["node", WORK / "connect.bundle.mjs", f"http://{address}"], capture_output=True, text=True, timeout=LONGEST
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return json.loads(run.stdout)


@pytest.mark.parametrize("messages", ["json", "proto"])
def test_connect_es_calls_and_tracks(in_node, messages):
    check(in_node[messages])
    check_tracked(in_node[messages]["tracked"])


def curl(*arguments):
    run = subprocess.run(["curl", "--silent", "--show-error", *arguments], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.mark.parametrize("version", ["--http1.1", "--http2-prior-knowledge"])
def test_curl_calls_with_json(address, version):
    json_type = ["--header", "content-type: application/json", "--data", json.dumps(REMOTE)]
    for packed in ([], ["--compressed"]):
        found = json.loads(curl(version, *packed, *json_type, f"http://{address}{FIND}"))
        assert found["outcome"] == "OUTCOME_FOUND"
        assert len(found["grasps"][0]["hand"]["joints"]) == 26
    # curl's own content type; the answer says which is right.
    refused = curl(version, "--data", "{}", f"http://{address}{FIND}")
    assert "application/json" in refused


def test_curl_asks_for_health(address):
    url = f"http://{address}/grpc.health.v1.Health/Check"
    assert json.loads(curl("--json", "{}", url)) == {"status": "SERVING"}


def post(address, path, content, **headers):
    request = urllib.request.Request(f"http://{address}{path}", content, {"content-type": "application/json", **headers})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return answer.read()


def test_python_calls_without_a_library(address):
    found = json.loads(post(address, FIND, json.dumps(REMOTE).encode()))
    assert found["outcome"] == "OUTCOME_FOUND"
    with pytest.raises(urllib.error.HTTPError) as raised:
        post(address, FIND, b'{"holdout": {"objekt": "objects/remote"}}')
    assert raised.value.code == 400
    error = json.load(raised.value)
    assert error["code"] == "invalid_argument"
    (violation,) = [
        violation
        for detail in error["details"]
        if detail["type"] == "google.rpc.BadRequest"
        for violation in detail["debug"]["fieldViolations"]
    ]
    assert violation["field"] == "holdout.objekt" and "object" in violation["description"]
    from grpc_status import rpc_status  # noqa: F401 (registers the types of details)
    from google.rpc import error_details_pb2

    (value,) = [detail["value"] for detail in error["details"] if detail["type"] == "google.rpc.BadRequest"]
    bad = error_details_pb2.BadRequest.FromString(base64.b64decode(value + "=" * (-len(value) % 4)))
    assert bad.field_violations[0].field == violation["field"]
    with pytest.raises(urllib.error.HTTPError) as raised:
        post(address, FIND, json.dumps(REMOTE).encode(), **{"connect-timeout-ms": "0"})
    assert (raised.value.code, json.load(raised.value)["code"]) == (504, "deadline_exceeded")


def test_buf_curl_calls_over_connect(address):
    run = subprocess.run(
        ["buf", "curl", "--protocol", "connect", "--schema", "proto", "-d", json.dumps(REMOTE), f"http://{address}{FIND}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["outcome"] == "OUTCOME_FOUND"


def test_buf_curl_reads_reflection_over_connect(address):
    # Reflection streams both ways, for which Connect needs HTTP/2.
    run = subprocess.run(
        ["buf", "curl", "--protocol", "connect", "--http2-prior-knowledge", "-d", json.dumps(REMOTE), f"http://{address}{FIND}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["outcome"] == "OUTCOME_FOUND"
