"""What a tuning run keeps on disk, so that it can be killed at any moment and resumed.

An update's history line is written first, the agent that counts it last: after a crash between the
two the history is cut back to the agent, and the update is run again with the same result.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import IO, Any

from drs_core import json_lines, versions
from drs_core.agent import Agent, load
from drs_core.errors import UsageError, presentable, shown
from drs_core.files import (
    clear_unfinished,
    lock_folder,
    make_folder,
    parse_json,
    read_bounded,
    refuse_link,
    write_atomically,
)
from drs_core.versions import Part, Versions

FORMAT = 1
MAX_RUN_JSON_BYTES = 2**20
MOST_WEIGHT_KEPT = 1e100
"""Of an objective, whose square has to be finite; a measured weight is far below."""
MOST_RECORD_BYTES = 2**15
"""Of a line: an evaluation's 1000 objectives, of 24 characters each, are the most."""
BEFORE = {
    "backend": "python",
    "attempts": 3,
    "action_change_max": 0.0,
    "top": 0,
    "back_off": False,
    "action_gains": False,
    "paired_spread": False,
}
"""Settings that folders of earlier versions do not name, and what they were."""
_RESUMED, _COUNTER = "resumed_with", "update"


class RunFolder:
    """Files of one run: run.json, history.jsonl, evaluations.jsonl, agent, best and observations .safetensors."""

    def __init__(self, path: Path) -> None:
        """Name the files; nothing is touched yet."""
        self.path = path
        self.run_json = path / "run.json"
        self.history = path / "history.jsonl"
        self.evaluations = path / "evaluations.jsonl"
        self.agent = path / "agent.safetensors"
        self.best = path / "best.safetensors"
        self.observations = path / "observations.safetensors"
        self.tensorboard = path / "tensorboard"

    def exists(self) -> bool:
        """Whether a run has begun here."""
        return self.run_json.exists()

    def begin(
        self, agent: Agent, name: str, config: dict[str, Any], observations: tuple[bytes, dict[str, Any]] | None = None
    ) -> IO[str]:
        """Begin a run, and keep others out of it as `lock` does; `observations` as `keep_observations` takes them.

        Raises:
            UsageError: a run or an agent is here already, and nothing of it is touched; or another process is at work.
            DrsError: the folder cannot be made or written.
        """
        self._check_free(observations)
        make_folder(self.path)
        lock = self.lock()
        # once more: another process may have begun one before the lock
        self._check_free(observations)
        content = {
            "format": FORMAT,
            "agent": {"name": name, "environment": agent.environment, "digest": agent.digest()},
            "config": config,
            "versions": versions.installed(),
        }
        if observations is not None:
            # before run.json: no run may ever be continued without them
            write_atomically(self.observations, observations[0])
            content["observations"] = observations[1]
        self._write(content)
        return lock

    def _check_free(self, observations: tuple[bytes, dict[str, Any]] | None) -> None:
        # these very observations are no run: one that was killed while it began has left them
        files = (self.run_json, self.agent, self.best, self.history, self.evaluations, self.observations)
        for taken in (*files, self.tensorboard):
            if taken.exists() and not (taken == self.observations and observations and _holds(taken, observations[0])):
                mend = "continue it with --resume or choose another folder"
                if not self.exists():
                    mend = f"it cannot be continued without {self.run_json.name}: choose another folder"
                raise UsageError(f"{self.path} holds a run already; {mend}.")

    def _write(self, content: dict[str, Any]) -> None:
        write_atomically(self.run_json, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())

    def lock(self) -> IO[str]:
        """Keep other processes out until the returned file is closed, or this process ends in any way.

        Raises:
            UsageError: another one is at work here, or what would be written is a link to another place.
            DrsError: the folder cannot be written.
        """
        for added_to in (self.history, self.evaluations, self.tensorboard):
            refuse_link(added_to)
        lock = lock_folder(self.path)
        # nobody else writes these now: what is there was begun by a process that was killed
        for name in (self.run_json, self.agent, self.best, self.history, self.evaluations, self.observations):
            clear_unfinished(name)
        return lock

    def setting(self, name: str) -> Any:
        """What a setting of this run is; None where it is not recorded.

        Raises:
            UsageError: the record is of no run that can be continued.
        """
        return _setting(self._stored(), name)

    def _stored(self) -> dict[str, Any]:
        stored = parse_json(read_bounded(self.run_json, MAX_RUN_JSON_BYTES), str(self.run_json))
        if not isinstance(stored, dict) or stored.get("format") != FORMAT:
            raise UsageError(f"{self.run_json} is not of a run that this version can continue.")
        return stored

    def check(self, agent: Agent, config: dict[str, Any]) -> None:
        """Raise UsageError, which names all that differs, unless this run was begun with this agent and config."""
        stored = self._stored()
        if not isinstance(stored.get("config"), dict):
            raise UsageError(f"{self.run_json} has no settings below config; choose a new folder.")
        # what is maximised comes first: it decides what the others are where they were not given
        given = sorted(json.loads(json.dumps(config)).items(), key=lambda setting: setting[0] != "objective")
        differing = [(key, _setting(stored, key), value) for key, value in given if _setting(stored, key) != value]
        if differing:
            told = "; ".join(f"{key} = {_told(there)}, not {_told(value)}" for key, there, value in differing)
            raise UsageError(
                f"{self.path} was begun with {told}. The command that began it goes on (drs tune: with --resume): "
                "give the same options, for example by the same --params file, or a new folder."
            )
        known = stored.get("agent")
        if not isinstance(known, dict) or known.get("digest") != agent.digest():
            raise UsageError(f"{self.path} was begun with another agent; give the same one, or a new folder.")

    def made_with(self) -> list[Part]:
        """Which versions made the run, each with the number of updates that were done before.

        Raises:
            UsageError: what stands there is none.
        """
        return _made_with(self._stored(), self.run_json)

    def goes_on_with(self, now: Versions, done: int) -> None:
        """Keep that after `done` updates the run goes on with the versions `now`, where its newest part has others.

        Raises:
            UsageError: what stands there of versions is none.
        """
        stored = self._stored()
        parts = _made_with(stored, self.run_json)
        longer = versions.extended(parts, done, now)
        if longer != parts:
            self._write(stored | {_RESUMED: versions.kept(longer[1:], _COUNTER)})

    def told_of(self, now: Versions) -> str | None:
        """A sentence for who goes on with the versions `now`, where any part of the run has others.

        Raises:
            UsageError: what stands there of versions is none.
        """
        differing = versions.others(self.made_with(), now, "before")
        if not differing:
            return None
        return presentable(
            f"{self.path} goes on with {versions.listed(differing)}: "
            "its results may differ from those of a run with one set of versions."
        )

    def keep_baseline(self, figures: dict[str, Any]) -> None:
        """Add to run.json what was measured before the first update, `smoothness_weight` with it."""
        self._write(self._stored() | {"baseline": figures})

    def baseline_weight(self) -> float | None:
        """The weight that the baseline gave; None before it was measured.

        Raises:
            UsageError: what stands there is no weight.
        """
        figures = self._stored().get("baseline")
        if figures is None:
            return None
        weight = figures.get("smoothness_weight") if isinstance(figures, dict) else None
        if not isinstance(weight, float) or not 0.0 <= weight <= MOST_WEIGHT_KEPT:
            raise UsageError(f"{self.run_json} has no valid smoothness_weight below baseline; choose a new folder.")
        return weight

    def keep_observations(self, content: bytes, facts: dict[str, Any]) -> None:
        """Keep the file of observations; `facts` of it, `sha256` among them, go to run.json once it is there."""
        write_atomically(self.observations, content)
        self._write(self._stored() | {"observations": facts})

    def observations_facts(self) -> dict[str, Any] | None:
        """Of the observations that the run keeps, `source` and `sha256` among them; None before there are any.

        Raises:
            UsageError: what stands there is none.
        """
        facts = self._stored().get("observations")
        if facts is None:
            return None
        if not isinstance(facts, dict) or not all(isinstance(facts.get(key), str) for key in ("source", "sha256")):
            raise UsageError(f"{self.run_json} has no valid source and sha256 below observations; choose a new folder.")
        return facts

    def latest(self, start: Agent, updates: int) -> tuple[Agent, int]:
        """The newest agent and how many of `updates` it has had; cuts the records back to it.

        Raises:
            UsageError: a file is damaged or of another run.
        """
        agent, done = start, 0
        if self.agent.exists():
            agent = load(self.agent)
            done = updates_done(agent)
            if (agent.environment, agent.network) != (start.environment, start.network) or done > updates:
                raise UsageError(f"{self.agent} is not of this run; put the right file back or choose a new folder.")
        for records in (self.history, self.evaluations):
            if records.exists() and records.stat().st_size > (updates + 2) * MOST_RECORD_BYTES:
                raise UsageError(
                    f"{records} is larger than what {updates} updates write; put the right file back or choose a new "
                    "folder."
                )
        # before anything is cut: what is wrong may be the agent
        self._check_best(start, done)
        json_lines.cut_back(self.history, done)
        json_lines.cut_back(self.evaluations, done)
        return agent, done

    def best_score(self) -> float | None:
        """Objective of the best agent's evaluation; None before the first one.

        Raises:
            UsageError: best.safetensors is not of a run.
        """
        return self._score(load(self.best)) if self.best.exists() else None

    def _score(self, best: Agent) -> float:
        score = best.tuning[-1].get("objective_mean") if best.tuning else None
        if not isinstance(score, float):
            raise UsageError(f"{self.best} has no evaluation in its record; the run cannot be continued.")
        return score

    def _check_best(self, start: Agent, done: int) -> None:
        """Raise UsageError unless the best agent is that of the evaluations until now."""
        # those without objectives are not whole, and no agent is the best by them
        kept = [record for record in json_lines.read(self.evaluations) if "objectives" in record]
        scores = {record["update"]: record.get("objective_mean") for record in kept if record["update"] <= done}
        mend = "put the right file back or choose a new folder"
        if not self.best.exists():
            if scores:
                raise UsageError(f"{self.best} is gone, the best agent of {len(scores)} evaluations; {mend}.")
            return
        best = load(self.best)
        score, update = self._score(best), updates_done(best)
        if (best.environment, best.network) != (start.environment, start.network):
            raise UsageError(f"{self.best} is of another agent than this run's; {mend}.")
        if update > done:
            raise UsageError(f"{self.best} is of update {update}, but {self.agent.name} of update {done}; {mend}.")
        # after a crash its own evaluation may not be recorded yet
        if scores.get(update, score) != score:
            raise UsageError(f"{self.best} is not the agent that was evaluated after update {update}; {mend}.")

    def newest_evaluation(self) -> int | None:
        """The update after which an evaluation was recorded last; None before the first one."""
        records = json_lines.read(self.evaluations)
        return records[-1]["update"] if records else None


def _holds(path: Path, content: bytes) -> bool:
    return path.stat().st_size == len(content) and path.read_bytes() == content


def _made_with(stored: dict[str, Any], path: Path) -> list[Part]:
    resumed = versions.read(stored.get(_RESUMED, []), _COUNTER)
    if resumed is None:
        raise UsageError(f"{path} has no valid updates and versions below {_RESUMED}; choose a new folder.")
    return [Part(0, versions.known(stored.get("versions"))), *resumed]


def _told(value: Any) -> str:
    """A setting in a message: words without quotes, and nothing that is too long, whoever wrote the file."""
    return shown(value)[1:-1] if isinstance(value, str) else shown(value)


def _setting(stored: dict[str, Any], name: str) -> Any:
    begun = stored.get("config")
    return begun.get(name, BEFORE.get(name)) if isinstance(begun, dict) else None


def updates_done(agent: Agent) -> int:
    """Updates of the newest tuning record.

    Raises:
        UsageError: the agent was not tuned.
    """
    done = agent.tuning[-1].get("updates_done") if agent.tuning else None
    if not isinstance(done, int) or done < 0:
        raise UsageError("The run folder's agent has no tuning record; the run cannot be continued.")
    return done
