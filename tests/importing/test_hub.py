"""Hub ids, against a server on this machine that speaks the hub's protocol."""

import hashlib
import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from drs_core.errors import UsageError
from drs_core.importing.hub import fetch
from tests.conftest import drs, refused

REVISION = "0123456789abcdef0123456789abcdef01234567"


class Hub(ThreadingHTTPServer):
    """Serves `files` as the repository sb3/agent; `sizes` may lie about them."""

    def __init__(self, files, sizes=None):
        super().__init__(("127.0.0.1", 0), Handler)
        self.files, self.sizes, self.fetched = files, sizes or {}, []
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server_port}"


class Handler(BaseHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def do_HEAD(self):
        self.do_GET()

    def do_GET(self):
        path, files = self.path.split("?")[0], self.server.files
        prefix = f"/sb3/agent/resolve/{REVISION}/"
        if path == "/api/models/sb3/agent":
            siblings = [
                {"rfilename": name, "size": self.server.sizes.get(name, len(content)), "blobId": "0"}
                for name, content in files.items()
            ]
            self.answer(json.dumps({"id": "sb3/agent", "sha": REVISION, "siblings": siblings}).encode())
        elif path.startswith(prefix) and path.removeprefix(prefix) in files:
            self.server.fetched.append(path.removeprefix(prefix))
            self.answer(files[path.removeprefix(prefix)])
        else:
            self.answer(b"{}", 404, {"X-Error-Code": "RepoNotFound"})

    def answer(self, content, status=200, more=None):
        self.send_response(status)
        etag = hashlib.sha1(content, usedforsecurity=False).hexdigest()
        for name, value in {"ETag": f'"{etag}"', "X-Repo-Commit": REVISION, **(more or {})}.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(content)


@pytest.fixture
def hopper_files(shared):
    """A zoo agent laid out as the hub's sb3 organisation does."""
    folder = shared / "agents/a2c/HopperBulletEnv-v0_1"
    inner = folder / "HopperBulletEnv-v0"
    return {
        "a2c-HopperBulletEnv-v0.zip": (folder / "HopperBulletEnv-v0.zip").read_bytes(),
        "config.yml": (inner / "config.yml").read_bytes(),
        "args.yml": (inner / "args.yml").read_bytes(),
        "env_kwargs.yml": b"{}\n",
        "vec_normalize.pkl": (inner / "vecnormalize.pkl").read_bytes(),
        "train_eval_metrics.zip": b"not an agent",
        "replay.mp4": b"a film",
        "README.md": b"",
    }


def test_an_agent_of_the_hub_is_the_agent_of_the_zoo(hopper_files, shared, tmp_path):
    hub, output = Hub(hopper_files), tmp_path / "hub.safetensors"
    environment = {"HF_ENDPOINT": hub.url, "HF_HOME": str(tmp_path / "cache"), "NO_PROXY": "127.0.0.1"}
    done = drs("import", "hf:sb3/agent", "-o", output, **environment)
    assert done.returncode == 0, done.stderr
    assert "replay.mp4" not in hub.fetched and "train_eval_metrics.zip" not in hub.fetched
    from drs_core.agent import load
    from drs_core.importing import import_agent

    assert load(output).digest() == import_agent(str(shared / "agents/a2c/HopperBulletEnv-v0_1")).digest()
    hub.shutdown()


def test_a_repository_without_agent_too_large_or_missing(tmp_path):
    cache = {"HF_HOME": str(tmp_path / "cache"), "NO_PROXY": "127.0.0.1"}
    output = tmp_path / "o.safetensors"
    empty = Hub({"README.md": b""})
    refused(drs("import", "hf:sb3/agent", "-o", output, HF_ENDPOINT=empty.url, **cache), "no Stable-Baselines3 zip")
    refused(drs("import", "hf:sb3/other", "-o", output, HF_ENDPOINT=empty.url, **cache), "sb3/other")
    large = Hub({"agent.zip": b""}, sizes={"agent.zip": 10**12})
    refused(drs("import", "hf:sb3/agent", "-o", output, HF_ENDPOINT=large.url, **cache), "1000000000000 bytes")
    assert large.fetched == []
    url = empty.url
    for hub in (empty, large):
        hub.shutdown()
        hub.server_close()
    refused(drs("import", "hf:sb3/agent", "-o", output, HF_ENDPOINT=url, **cache), "Cannot fetch hf:sb3/agent")
    assert not output.exists()


@pytest.mark.parametrize("name", ["hf:", "hf:a", "hf:a/b/c", "hf:../x", "hf:a/..", "hf:a b/c", "hf:a/" + "b" * 200])
def test_what_is_no_hub_id(name):
    with pytest.raises(UsageError, match="not a hub id"):
        fetch(name)
