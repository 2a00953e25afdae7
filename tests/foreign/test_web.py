"""Pages call the server: connect-web, a client by others, in Node and in a headless Chromium, and buf curl over gRPC-Web."""

import http.server
import json
import os
import queue
import shutil
import subprocess
import tempfile
import threading

import pytest
from conftest import ROOT, start_server, stop_server

SOURCES = ROOT / "tests/foreign/web"
WORK = ROOT / "target/foreign"
# Longest time for all calls of a page, which takes seconds.
LONGEST = 120


@pytest.fixture(scope="module")
def bundles():
    """The calls with the generated code, for Node and for browsers."""
    plugin = {"local": "protoc-gen-es", "out": str(WORK / "es"), "opt": ["target=js"]}
    template = json.dumps({"version": "v2", "plugins": [plugin]})
    subprocess.run(["buf", "generate", "--template", template], cwd=ROOT / "proto", check=True, timeout=120)
    environment = {**os.environ, "NODE_PATH": str(WORK / "node_modules")}
    for name, platform in [("node", "node"), ("page", "browser")]:
        subprocess.run(
            [
                "esbuild",
                SOURCES / f"{name}.mjs",
                "--bundle",
                "--format=esm",
                f"--platform={platform}",
                f"--alias:#contract={WORK / 'es/grasp/v1'}",
                f"--outfile={WORK / f'{name}.bundle.mjs'}",
                "--log-level=warning",
            ],
            env=environment,
            check=True,
            timeout=120,
        )
    return WORK


def check(result):
    """Checks the results of every page."""
    assert "failed" not in result, result["failed"]
    found = result["found"]
    assert (found["outcome"], found["joints"]) == ("FOUND", 26)
    assert 0 < found["score"] <= 1
    rejection = result["rejection"]
    assert rejection["code"] == "InvalidArgument"
    assert "friction" in rejection["message"]
    assert {"google.rpc.ErrorInfo", "google.rpc.BadRequest"} <= set(rejection["details"])
    # The details show that the status is the server's.
    assert result["expired"]["code"] == "DeadlineExceeded"
    assert set(result["expired"]["details"]) == {"google.rpc.ErrorInfo", "google.rpc.RequestInfo"}
    scores = result["streamed"]["scores"]
    assert scores and all(a < b for a, b in zip(scores, scores[1:]))
    assert result["streamed"]["outcome"] == "FOUND"
    assert result["left"] == "Canceled"


def check_tracked(answers):
    """Checks a tracked motion: every frame is answered, and the hand keeps to the object."""
    assert [answer["sequence"] for answer in answers] == list(range(1, len(answers) + 1))
    assert answers[0]["status"] == "REPLANNED"
    for before, after in zip(answers, answers[1:]):
        if after["status"] == "KEPT":
            assert abs(after["x"] - before["x"]) < 1e-4
    assert sum(answer["status"] == "KEPT" for answer in answers) > len(answers) // 2


@pytest.fixture(scope="module")
def in_node(address, bundles):
    run = subprocess.run(
        ["node", bundles / "node.bundle.mjs", f"http://{address}"],
        capture_output=True,
        text=True,
        timeout=LONGEST,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return json.loads(run.stdout)


def test_node_calls_over_grpc_web(in_node):
    check(in_node)


def test_node_tracks_a_motion(in_node):
    check_tracked(in_node["tracked"])


@pytest.fixture(scope="module")
def page(bundles):
    """A server of the page, and the queue of its posts."""
    results = queue.Queue()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            if self.path.endswith(".mjs"):
                content, kind = (bundles / "page.bundle.mjs").read_bytes(), "text/javascript"
            else:
                content, kind = b'<!doctype html><script type="module" src="/page.mjs"></script>', "text/html"
            self.send_response(200)
            self.send_header("content-type", kind)
            self.send_header("content-length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def do_POST(self):
            results.put(json.loads(self.rfile.read(int(self.headers["content-length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}", results
        server.shutdown()


@pytest.fixture(scope="module")
def in_browser(address, page):
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("there is no Chromium")
    origin, results = page
    forbidding, forbidding_address = start_server("--listen", "127.0.0.1:0", "--web-origins", "https://game.example")
    with tempfile.TemporaryDirectory() as profile:
        url = f"{origin}/?server=http://{address}&forbidding=http://{forbidding_address}"
        # Its sandbox needs rights that containers lack; it loads nothing but the page above.
        options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]
        browser = subprocess.Popen(
            [chromium, *options, "--remote-debugging-port=0", f"--user-data-dir={profile}", url],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            yield results.get(timeout=LONGEST)
        finally:
            browser.terminate()
            browser.wait(timeout=20)
            stop_server(forbidding)


def test_a_browser_calls_over_grpc_web(in_browser):
    check(in_browser)


def test_a_browser_refuses_a_page_that_may_not_call(in_browser):
    assert in_browser["refused"] is not None
    assert "fetch" in in_browser["refused"].lower(), in_browser["refused"]


def test_a_browser_tracks_a_motion(in_browser):
    check_tracked(in_browser["tracked"])


def test_buf_curl_calls_over_grpc_web(address):
    # Over HTTP/1.1, with the contract's files in place of reflection, which streams both ways.
    run = subprocess.run(
        ["buf", "curl", "--protocol", "grpcweb", "--schema", "proto"]
        + ["-d", '{"holdout": {"object": "objects/remote"}, "search": {"seed": 1}}', f"http://{address}/grasp.v1.GraspService/FindGrasp"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["outcome"] == "OUTCOME_FOUND"
