"""Calls the service in a container through its published port."""

import datetime
import json
import pathlib
import re
import time

from conftest import ENGINE, engine, grasp, inspect, report_figure, run, skip, wait_for

FIND = ["find", "--holdout", "scissors-hold1", "--seed", "7", "--reproducible", "--budget", "10s", "--json"]


def test_answers_the_client(start):
    begin = time.monotonic()
    service = start()
    report_figure("time from the engine's start to an answer", f"{1000 * (time.monotonic() - begin):.0f} ms")
    address = service.address()
    assert grasp(address, "health").stdout.strip() == "serving"
    listed = json.loads(grasp(address, "objects", "list", "--json").stdout)
    names = [thing["name"] for thing in listed["objects"]]
    assert names == ["objects/remote", "objects/scalpel", "objects/scissors"]
    found = grasp(address, *FIND)
    assert found.returncode == 0, found.stderr


def is_nearly(one, other):
    """Equal but for the last digits: C libraries round sines differently, and answers repeat on one platform only."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(is_nearly(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(is_nearly, one, other))
    if isinstance(one, float) and isinstance(other, (int, float)):
        return abs(one - other) <= 1e-4 * max(1.0, abs(one))
    return one == other


def test_seed_gives_the_same_grasp_as_on_the_host(start, host_server):
    # A server that has just started may still be loading its atlases.
    answers = [grasp(address, *FIND, "--ignore-atlas") for address in (start().address(), host_server)]
    assert [answer.returncode for answer in answers] == [0, 0]
    in_container, on_host = (json.loads(answer.stdout)["grasps"] for answer in answers)
    assert is_nearly(in_container, on_host), (in_container, on_host)


def test_runs_without_privileges(start):
    service = start()
    process = inspect(service.name, "{{.State.Pid}}")
    status = pathlib.Path("/proc", process, "status")
    if not status.exists() or "grasp-server" not in status.read_text():
        skip("privileges of the process: its /proc is not visible from the host")
    fields = dict(line.split(":\t", 1) for line in status.read_text().splitlines() if ":\t" in line)
    assert "0" not in fields["Uid"].split()
    assert int(fields["CapEff"], 16) == 0 and int(fields["CapPrm"], 16) == 0 and int(fields["CapBnd"], 16) == 0
    assert fields["NoNewPrivs"].strip() == "1"
    report_figure("resident memory at rest", fields["VmRSS"].strip())


def test_health_check_works_inside_the_container(start):
    service = start()
    check = run(ENGINE, "exec", service.name, "/grasp-server", "--health-check")
    assert (check.returncode, check.stdout + check.stderr) == (0, "")
    # A port where nothing listens.
    check = run(ENGINE, "exec", "--env", "GRASP_LISTEN=0.0.0.0:9", service.name, "/grasp-server", "--health-check")
    assert check.returncode == 1
    assert "cannot connect to 127.0.0.1:9" in check.stdout + check.stderr


def test_engine_reports_it_healthy(start):
    service = start()
    if ENGINE == "podman":
        # podman schedules health checks with systemd, which may be missing.
        engine("healthcheck", "run", service.name)
    wait_for("health", lambda: "healthy" == inspect(service.name, "{{.State.Health.Status}}"))


def test_environment_configures_the_service(start):
    service = start(environment={"GRASP_MAXIMUM_OBJECT_TRIANGLES": "4", "GRASP_LISTEN": "0.0.0.0:50051"})
    mesh = "assets/objects/remote.obj"
    rejected = grasp(service.address(), "objects", "create", "--mesh", mesh, "--mass", "0.1", "mesh")
    assert rejected.returncode == 4
    assert "more than 4 " in rejected.stderr


def test_serves_a_mounted_folder_of_objects(start, objects, tmp_path):
    service = start(mounts={objects: "/objects"})
    about = json.loads(grasp(service.address(), "objects", "get", "my-remote", "--json").stdout)
    built_in = json.loads(grasp(service.address(), "objects", "get", "remote", "--json").stdout)
    assert about["contentHash"] == built_in["contentHash"] and not about.get("builtIn")
    found = []
    for name in ("objects/my-remote", "objects/remote"):
        request = tmp_path / "request.json"
        # Only the built-in one has an atlas by now.
        search = {"seed": "3", "choice": "GRASP_CHOICE_REPRODUCIBLE", "ignoreAtlas": True, "budget": "10s"}
        request.write_text(json.dumps({"holdout": {"object": name}, "search": search}))
        answer = grasp(service.address(), "find", "--request", request, "--json")
        assert answer.returncode == 0, answer.stderr
        found.append(json.loads(answer.stdout)["grasps"])
    assert found[0] == found[1]


def test_log_lines_are_json(start):
    service = start()
    grasp(service.address(), *FIND)
    grasp(service.address(), "objects", "get", "nothing")
    started = inspect(service.name, "{{json .State.StartedAt}}")
    engine("stop", service.name)
    lines = [json.loads(line) for line in service.log().splitlines()]
    messages = [line["message"] for line in lines]
    assert "serving" in messages and "stopped" in messages
    assert sum("FindGrasp" in json.dumps(line) for line in lines) == 1
    # The engine prints nanoseconds, Python parses microseconds.
    serving = lines[messages.index("serving")]["timestamp"]
    moments = [re.sub(r"(\.\d{6})\d*", r"\1", text.strip('"')) for text in (started, serving)]
    begin, ready = (datetime.datetime.fromisoformat(moment.replace("Z", "+00:00")) for moment in moments)
    report_figure("from the start of the container to readiness", f"{1000 * (ready - begin).total_seconds():.0f} ms")


def test_restarts_after_being_killed(start):
    service = start()
    engine("kill", "--signal", "KILL", service.name)
    wait_for("the exit", lambda: not service.is_running())
    assert service.exit_code() == 137
    engine("start", service.name)
    service.wait_until_it_serves()
    assert grasp(service.address(), *FIND).returncode == 0


def test_sigterm_stops_it_cleanly(start):
    service = start()
    begin = time.monotonic()
    engine("kill", "--signal", "TERM", service.name)
    engine("wait", service.name)
    report_figure("from SIGTERM to exit, idle", f"{1000 * (time.monotonic() - begin):.0f} ms")
    assert service.exit_code() == 0
