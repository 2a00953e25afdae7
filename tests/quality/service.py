"""Runs the release server on a free port and calls it through the client's binary."""

import json
import os
import pathlib
import re
import signal
import subprocess
import threading
import time

from messages import answer_of, object_of, request_of, to_message

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Exit code of `grasp find` when it found no grasp within the budget.
EXHAUSTED = 3


class Service:
    """A running server, as a context manager."""

    def __init__(self, workers=None, *more):
        command = [ROOT / "target/release/grasp-server", "--listen", "127.0.0.1:0", "--log", "grasp_server=info"]
        # Complete atlases are grown once and shared with the Rust tests and benches.
        command += ["--atlas-directory", ROOT / "target/atlases"]
        if workers:
            command += ["--workers", str(workers)]
        command += more
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "NO_COLOR": "1", "GRASP_STORE": "memory"},
        )
        for line in self.process.stderr:
            if match := re.search(r"127\.0\.0\.1:\d+", line):
                self.url = f"http://{match.group(0)}"
                break
        else:
            raise RuntimeError(f"the server exited with {self.process.wait()} before it logged its address")
        # Drain the log: a full pipe would block the server.
        threading.Thread(target=lambda: self.process.stderr.read(), daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=20)

    def _run(self, *arguments, stdin=None, accept=(0,)):
        done = subprocess.run(
            [ROOT / "target/release/grasp", "--json", *map(str, arguments), "--server", self.url],
            input=stdin,
            capture_output=True,
            text=True,
            timeout=60,
            env={**os.environ, "NO_COLOR": "1", "GRASP_LOG": "grasp=debug"},
        )
        if done.returncode not in accept:
            raise RuntimeError(f"grasp {arguments[0]} exited with {done.returncode}: {done.stderr.strip()}")
        return done

    def _object(self, *arguments):
        return object_of(json.loads(self._run("objects", *arguments).stdout))

    def create(self, identifier, path, mass, *more):
        """Creates an object from a file and returns the server's description of it; `more` are options of the client."""
        return self._object("create", identifier, "--mesh", path, "--mass", mass, *more)

    def object(self, name):
        """The server's description of an object."""
        return self._object("get", name)

    def wait_for_atlases(self, names, seconds=600):
        """Returns once the atlases of some objects are complete, which takes a minute or two the first time."""
        deadline = time.monotonic() + seconds
        for name in names:
            # Only complete atlases answer reproducible requests.
            request = {"object": f"objects/{name}", "receiving_hand": {"handedness": "right"}, "choice": "reproducible"}
            while not self.find({**request, "max_attempts": 1, "budget_seconds": 0.05})["atlases"]:
                if time.monotonic() > deadline:
                    raise RuntimeError(f"the atlas of {name} is not complete after {seconds} s")
                time.sleep(0.2)

    def find(self, request, choice=None, no_atlas=False, picture=None):
        """The answer to a request, with the time that it took."""
        extra = ["--png", picture, "--view-size", "480x400"] if picture else []
        asked = {**request, "choice": choice or request.get("choice"), "ignore_atlas": no_atlas or None}
        message = json.dumps(to_message(asked))
        done = self._run("find", "--request", "-", *extra, stdin=message, accept=(0, EXHAUSTED))
        answer = answer_of(json.loads(done.stdout))
        answer["round_trip_seconds"] = float(re.search(r"round_trip_seconds=([0-9.e-]+)", done.stderr).group(1))
        return answer


def built_in_request(holdout):
    """The request of a built-in holdout."""
    done = subprocess.run(
        [ROOT / "target/release/grasp", "find", "--holdout", holdout, "--print-request"],
        capture_output=True,
        text=True,
        check=True,
        timeout=20,
    )
    return request_of(json.loads(done.stdout))
