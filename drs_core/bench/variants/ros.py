"""This project over ROS 2: the workspace's own executable runs the simulator nodes, in another process."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from drs_core.agent import Agent
from drs_core.bench.sample import Sample
from drs_core.bench.variants import Absent
from drs_core.errors import DrsError
from drs_core.graph import DEFAULTS, workspace

_EXECUTABLE = "bench_rollouts"
_DOMAINS = 100
_SHOWN_LINES = 5
_ENDING_S = 30.0


class OverRos:
    """Rollouts over simulator nodes, in a domain that nobody else is likely to use."""

    def __init__(self, agent: Agent, nodes: int) -> None:
        """Start the nodes and wait until they answer.

        Raises:
            Absent: there is no workspace.
            DrsError: the nodes do not start.
        """
        command = _command()
        self._folder = tempfile.TemporaryDirectory(prefix="drs-bench-")
        folder = Path(self._folder.name)
        agent.save(folder / "agent.safetensors")
        self._log = folder / "log"
        # simulators of other people must not take part
        domain = {"ROS_DOMAIN_ID": str(1 + os.getpid() % _DOMAINS), "ROS_LOG_DIR": str(folder)}
        with open(self._log, "wb") as log:
            self._process = subprocess.Popen(
                ["bash", "-c", f"{command} {shlex.quote(str(folder / 'agent.safetensors'))} {nodes}"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                env={**DEFAULTS, **os.environ, **domain},
            )
        try:
            self._answer()
        except BaseException:
            self.close()
            raise

    def run(self, seed: int, steps: int) -> Sample:
        """The episode of this seed, again and again, at least four times for each node."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"seed": seed, "steps": steps}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # it has ended: reading says so, with what it said
        return Sample(**self._answer())

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            last = self._log.read_text(errors="replace").strip().splitlines()[-_SHOWN_LINES:]
            raise DrsError(f"The simulator nodes ended; they said: {' / '.join(last) or 'nothing'}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        """End the nodes."""
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.close()
        except BrokenPipeError:
            pass
        try:
            self._process.wait(_ENDING_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()
        self._folder.cleanup()


def _command() -> str:
    try:
        prefix, setup = workspace(os.environ)
    except DrsError as error:
        raise Absent(str(error)) from error
    executable = prefix / "lib" / "drs" / _EXECUTABLE
    if not executable.exists():
        raise Absent(f"the workspace has no {_EXECUTABLE}; build it again: make ros")
    start = f"exec {shlex.quote(str(executable))}"
    return start if setup is None else f"source {shlex.quote(str(setup))} && {start}"
