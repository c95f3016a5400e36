"""What a simulator does for its services, free of ROS: agents, parameter vectors, batches of episodes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from drs_core.accelerator import PLAIN, PYTHON, Runner, make_runner
from drs_core.accelerator.backend import Accelerated
from drs_core.agent import SUFFIX, Agent, load
from drs_core.environments import current_name
from drs_core.episode import Episode, EpisodeRunner
from drs_core.errors import DrsError, UsageError
from drs_core.policy import Float32
from drs_core.rollouts import Task
from drs_core.rollouts.task import run_task

MAX_AGENT_BYTES = 64 * 2**20
IDLE_S = 10.0


class NotHeldError(UsageError):
    """The agent, backend or theta of the request is not in force: whoever asks sends it again."""


def agent_from_bytes(content: bytes) -> Agent:
    """An agent file's content -> Agent.

    Raises:
        UsageError: it is too large, or not an agent file.
    """
    if len(content) > MAX_AGENT_BYTES:
        raise UsageError(f"The agent file has {len(content)} bytes; allowed are at most {MAX_AGENT_BYTES}.")
    with tempfile.TemporaryDirectory(prefix="drs-") as folder:
        path = Path(folder) / f"received{SUFFIX}"
        path.write_bytes(content)
        return load(path)


class EpisodeService:
    """Runs episodes of the loaded agent; one environment, made when the agent is loaded."""

    def __init__(self, environment: str = "", fast: bool = True) -> None:
        """Only agents of this environment are taken; empty: of any. `fast` as in `Environment`.

        Nothing is simulated before an agent is loaded, nor long after the last episode: a simulator
        costs 40 MB.
        """
        self._only = current_name(environment) if environment else ""
        self._fast = fast
        self._runner: Runner | None = None
        self._theta_digest = ""
        self._closing, self._last_run_s = False, 0.0
        self.agent: Agent | None = None
        self.agent_digest = self.backend = ""

    def load(self, agent: Agent, digest: str = "", backend: str = "python") -> None:
        """Run this agent on this backend from now on; the one before stays where this raises.

        Raises:
            UsageError: the digest is of another agent, or the agent does not fit its environment.
            DrsError: this machine cannot run the backend.
        """
        found = agent.digest()
        if digest and digest != found:
            raise UsageError(f"The agent's digest is {found[:16]}…, not {digest[:16]}…: another agent of that name.")
        if self._only and agent.environment != self._only:
            raise UsageError(f"The agent is of {agent.environment}, and this simulator runs {self._only} only.")
        if (found, backend) != (self.agent_digest, self.backend):
            runner = self.make(agent, backend)
            self.close()
            self._runner, self.agent, self.agent_digest, self.backend = runner, agent, found, backend
            self._last_run_s = time.monotonic()
        # also where it is loaded already: this agent, and not what a tuner has made of it since
        self._theta, self._theta_digest = agent.theta, ""

    @property
    def parameters(self) -> int:
        """D of the loaded agent.

        Raises:
            NotHeldError: no agent is loaded.
        """
        return len(self._loaded("").theta)

    def check_length(self, theta: Float32, agent_digest: str) -> None:
        """Raise UsageError where no agent is loaded, or theta is of another one."""
        d = len(self._loaded(agent_digest).theta)
        if len(theta) != d:
            raise UsageError(f"theta has {len(theta)} numbers; the agent's policy has {d}.")

    def check_held(self, agent_digest: str, theta_digest: str, backend: str) -> Agent:
        """The loaded agent.

        Raises:
            NotHeldError: there is none, or another agent, theta or backend is in force; empty ones are not checked.
        """
        agent = self._loaded(agent_digest)
        if theta_digest and theta_digest != self._theta_digest:
            raise NotHeldError(f"theta is not {theta_digest[:16]}…; send it with set_parameters_vector first.")
        if backend and backend != self.backend:
            raise NotHeldError(f"The agent runs on {self.backend}, not on {backend}; call load_agent first.")
        return agent

    def set_theta(self, theta: Float32, digest: str) -> None:
        """Candidates perturb theta (d,) from now on; `digest` is that of theta."""
        self._theta, self._theta_digest = theta, digest

    def run(
        self, tasks: Sequence[Task], agent_digest: str = "", theta_digest: str = "", backend: str = ""
    ) -> tuple[list[Episode], float]:
        """Every task's episode in order, and how long they took together [s].

        Raises:
            NotHeldError: as `check_held`.
            DrsError: an episode failed, or the node is shutting down.
        """
        agent = self.check_held(agent_digest, theta_digest, backend)
        if self._runner is None:
            self._runner = self.make(agent, self.backend)
        start = time.perf_counter()
        episodes = []
        for task in tasks:
            if self._closing:
                raise DrsError("The simulator is shutting down.")
            try:
                episodes.append(run_task(self._runner, self._theta, task))
            except BaseException:
                # a simulator may hold what broke the episode, and no reset may take it away; an arm's own runner
                # may know that somebody has to look first
                if isinstance(self._runner, EpisodeRunner | Accelerated):
                    self.close()
                raise
        self._last_run_s = time.monotonic()
        return episodes, time.perf_counter() - start

    def rest(self) -> None:
        """Free the simulator where it has had nothing to do for a while; the next batch makes it again."""
        if time.monotonic() - self._last_run_s > IDLE_S:
            self.close()

    def make(self, agent: Agent, backend: str) -> Runner:
        """What runs the agent's episodes; the node of an arm puts its own in this place."""
        return make_runner(agent, PLAIN if backend == PYTHON and not self._fast else backend)

    def stop(self) -> None:
        """End a batch under way after its running episode; no other is begun."""
        self._closing = True

    def close(self) -> None:
        """Free the simulator."""
        if self._runner is not None:
            runner, self._runner = self._runner, None
            runner.close()

    def _loaded(self, digest: str) -> Agent:
        if self.agent is None:
            raise NotHeldError("No agent is loaded; call load_agent first.")
        if digest and digest != self.agent_digest:
            raise NotHeldError(
                f"The loaded agent is {self.agent_digest[:16]}…, not {digest[:16]}…; call load_agent first."
            )
        return self.agent
