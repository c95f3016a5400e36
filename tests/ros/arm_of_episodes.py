"""Stands in for an arm that runs episodes: the services of a simulator in the test's own process, and it breaks off."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from drs.episode_service import EpisodeService
from drs.episode_services import EpisodeServices
from drs_core.agent import Agent
from drs_core.episode import Episode, unfinished
from drs_core.errors import DrsError
from drs_core.rollouts import Task
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig
from tests.conftest import make_agent
from tests.ros.graph import Graph, NodeProcess

CONFIG = TuneConfig(
    SearchConfig(updates=3, directions=4, alpha=(0.3, 0.1), sigma=(0.3, 0.1), seed=5),
    evaluate_every=2,
    evaluation_episodes=3,
)

Breaks = Callable[[Task, int], bool]
"""A task and how often it was run, this time included -> whether it is broken off."""


class Arm(EpisodeService):
    """Runs episodes as `drs_core` does in one process; `stuck` says why it can do nothing at all."""

    def __init__(self, breaks: Breaks = lambda task, run: False) -> None:
        super().__init__()
        self.breaks, self.stuck = breaks, ""
        self.runs: Counter[Task] = Counter()

    def load(self, *arguments: Any) -> None:
        self._check()
        super().load(*arguments)

    def run(self, tasks: Sequence[Task], *digests: str) -> tuple[list[Episode], float]:
        self._check()
        episodes, wall_s = super().run(tasks, *digests)
        self.runs.update(tasks)
        broken = [self.breaks(task, self.runs[task]) for task in tasks]
        why = "the arm's reflex stopped it"
        return [unfinished(e.seed, why) if off else e for e, off in zip(episodes, broken, strict=True)], wall_s

    def _check(self) -> None:
        if self.stuck:
            raise DrsError(self.stuck)


def offer(graph: Graph, arm: Arm) -> Arm:
    """Put its services into the graph; they are served while the graph waits."""
    EpisodeServices(graph.client, arm, "", str(graph.folder))
    return arm


def agent_in(folder: Path) -> tuple[Agent, Path]:
    agent, path = make_agent(), folder / "begin.safetensors"
    agent.save(path)
    return agent, path


def tuner(graph: Graph, agent: Path, output: Path, name: str = "tuner_node", **more: Any) -> NodeProcess:
    search = CONFIG.search
    settings = {
        "agent": agent,
        "output": output,
        "updates": search.updates,
        "directions": search.directions,
        "alpha": list(search.alpha),
        "sigma": list(search.sigma),
        "seed": search.seed,
        "evaluate_every": CONFIG.evaluate_every,
        "evaluation_episodes": CONFIG.evaluation_episodes,
        "autostart": True,
        "exit_when_done": True,
    }
    return graph.start("tuner_node", name, **(settings | more))


def ended(graph: Graph, node: NodeProcess) -> None:
    """Wait for its end; the arm runs in the test's process, so all of it takes the time of one."""
    graph.wait(lambda: node.process.poll() is not None, f"the end of {node.name}", patience_s=150.0)
