"""What operators get from a container: metrics, probes, and the bill of materials. Prometheus' own tool checks metrics and alerts."""

import json
import re
import shutil
import subprocess
import urllib.error
import urllib.request

import pytest

from conftest import ROOT, WORK, engine, grasp, run, skip

MONITOR = "9464/tcp"


@pytest.fixture(scope="session")
def promtool():
    """The path of promtool: the system's, or that of Debian's package, which is unpacked but not installed."""
    if found := shutil.which("promtool"):
        return found
    unpacked = WORK / "prometheus"
    tool = unpacked / "usr/bin/promtool"
    if not tool.exists():
        unpacked.mkdir(exist_ok=True)
        for command in (["apt-get", "download", "prometheus"], ["sh", "-c", "dpkg -x prometheus_*.deb ."]):
            try:
                done = run(*command, cwd=unpacked)
            except FileNotFoundError:
                skip("metrics and alerts by promtool: no promtool, and no Debian packages")
            if done.returncode != 0:
                skip(f"metrics and alerts by promtool: {done.stderr.strip().splitlines()[-1]}")
    return tool


@pytest.fixture
def monitored(start):
    """A service with its port for operators, and a function that gets a path of that: the status and the text."""
    service = start("--publish", "127.0.0.1::9464", environment={"GRASP_METRICS_LISTEN": "0.0.0.0:9464"})
    address = engine("port", service.name, MONITOR).splitlines()[0]

    def get(path):
        try:
            with urllib.request.urlopen(f"http://{address}{path}", timeout=5) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()
        except OSError:
            return None, ""

    return service, get


def test_probes_tell_how_it_is(monitored):
    service, get = monitored
    assert get("/livez") == (200, "alive\n")
    assert get("/readyz") == (200, "ready\n")
    engine("stop", service.name)
    assert service.exit_code() == 0
    assert get("/readyz")[0] is None


def test_prometheus_understands_metrics_and_alerts(monitored, promtool):
    service, get = monitored
    assert grasp(service.address(), "find", "--holdout", "scissors-hold1", "--seed", "1").returncode == 0
    status, page = get("/metrics")
    assert status == 200
    assert re.search(r'grpc_server_handled_total\{.*"FindGrasp",grpc_code="OK"\} 1$', page, re.MULTILINE), page
    checked = subprocess.run([promtool, "check", "metrics"], input=page, capture_output=True, text=True, timeout=60)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    alerts = ROOT / "docker/prometheus/alerts.yaml"
    checked = run(promtool, "check", "rules", alerts)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert f"{alerts.read_text().count('- alert:')} rules found" in checked.stdout


def test_the_image_has_a_bill_of_materials(start, tmp_path):
    service = start(wait=False)
    engine("cp", f"{service.name}:/usr/share/doc/grasp/sbom.json", str(tmp_path))
    bill = json.loads((tmp_path / "sbom.json").read_text())
    assert bill["bomFormat"] == "CycloneDX" and bill["metadata"]["component"]["name"] == "grasp-server"
    lock = (ROOT / "Cargo.lock").read_text()
    names = set()
    for component in bill["components"]:
        names.add(component["name"])
        entry = f'name = "{component["name"]}"\nversion = "{component["version"]}"\n'
        assert entry in lock and component["licenses"][0]["expression"], component
        for checksum in component.get("hashes", []):
            assert f'checksum = "{checksum["content"]}"' in lock, component
    assert {"tonic", "tokio", "opentelemetry-otlp", "grasp-synthesis"} <= names and "grasp-cases" not in names
