"""A running server for the foreign clients, and the code that grpcio-tools generated from the contract."""

import os
import pathlib
import re
import signal
import subprocess
import sys
import threading

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "target" / "foreign"))


def start_server(*arguments):
    """Starts the release binary, which should listen on port 0; returns the process and its host:port."""
    process = subprocess.Popen(
        # Complete atlases are grown once and shared with the Rust tests and benches.
        [ROOT / "target/release/grasp-server", "--atlas-directory", ROOT / "target/atlases", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "NO_COLOR": "1", "GRASP_LOG": "info", "GRASP_STORE": "memory"},
    )
    for line in process.stderr:
        if match := re.search(r"(?:127\.0\.0\.1|\[::1\]):\d+", line):
            # Drains the rest of the log, or a full pipe would block the server.
            threading.Thread(target=process.stderr.read, daemon=True).start()
            return process, match.group(0)
    raise RuntimeError(f"the server exited with {process.wait()} before it logged its address")


def stop_server(process):
    """Checks that SIGTERM stops an idle server promptly and cleanly."""
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=10) == 0


@pytest.fixture(scope="session")
def address():
    process, host_port = start_server("--listen", "127.0.0.1:0")
    yield host_port
    stop_server(process)


@pytest.fixture(scope="session")
def channel(address):
    import grpc

    with grpc.insecure_channel(address) as opened:
        yield opened
