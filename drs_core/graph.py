"""The ROS 2 graph without `ros2 launch`: the same nodes, as processes that start and end together."""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drs_core.errors import DrsError, UsageError, install
from drs_core.graph_file import check_graph_file
from drs_core.plain_yaml import quoted

MAX_SIMULATORS = 64
DEFAULTS = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    # the process manager puts time and node before each line
    "RCUTILS_CONSOLE_OUTPUT_FORMAT": "{severity}: {message}",
    "PYTHONUNBUFFERED": "1",
}
_CHECKOUT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class GraphConfig:
    """Which nodes to start.

    Attributes:
        params: parameter file for all of them.
        simulators: how many; the first shows its robot on the topics, all run episodes.
        tune: tune at once, and end everything when that is done.
        output: run folder in place of the parameter file's.
    """

    params: Path
    simulators: int = 2
    tune: bool = False
    output: Path | None = None

    def __post_init__(self) -> None:
        """Raise UsageError where a value is not allowed."""
        if not self.params.is_file():
            raise UsageError(f"There is no parameter file {self.params}; check the path.")
        check_graph_file(self.params)
        if self.output is not None:
            # a name that ROS cannot be told
            quoted(str(self.output))
        if not 1 <= self.simulators <= MAX_SIMULATORS:
            raise UsageError(f"simulators is {self.simulators}; allowed are 1 to {MAX_SIMULATORS}.")


def node_commands(config: GraphConfig) -> dict[str, list[str]]:
    """Node name -> executable and its ROS arguments."""
    arguments = {"simulator_node": ["simulator_node"]}
    for number in range(2, config.simulators + 1):
        name = f"simulator_{number}"
        arguments[name] = ["simulator_node", "-r", f"__node:={name}", "-p", f"{name}:stream:=false"]
    # with the node's name before it, a setting wins over the parameter file's section of that name
    tuner = ["tuner_node"]
    if config.tune:
        tuner += ["-p", "tuner_node:autostart:=true", "-p", "tuner_node:exit_when_done:=true"]
    if config.output is not None:
        tuner += ["-p", f"tuner_node:output:={quoted(str(config.output))}"]
    arguments |= {"tuner_node": tuner, "policy_node": ["policy_node"]}
    common = ["--params-file", str(config.params.absolute())]
    return {name: [executable, "--ros-args", *common, *rest] for name, (executable, *rest) in arguments.items()}


def run_graph(config: GraphConfig) -> int:
    """Start every node and wait; the first that ends ends all. Returns its exit status, or 130 for Ctrl-C.

    Raises:
        DrsError: the nodes are not built, or honcho is not installed.
    """
    try:
        from honcho.manager import Manager
    except ModuleNotFoundError as error:
        raise DrsError(f"drs graph needs honcho; {install('graph')}.") from error
    environment = {**DEFAULTS, **os.environ}
    manager = Manager()
    for name, command in node_commands(config).items():
        manager.add_process(name, f"exec bash -c {shlex.quote(_script(command))}", env=environment)
    sys.stdout.flush()
    manager.loop()
    return int(manager.returncode or 0)


def node_process(executable: str, settings: Mapping[str, Any]) -> tuple[list[str], dict[str, str]]:
    """Command and environment of one node with these parameters.

    Raises:
        DrsError: the nodes are not built.
    """
    # ROS reads values as YAML, in which a number of JSON is taken for nothing else
    values = {name: quoted(value) if isinstance(value, str) else json.dumps(value) for name, value in settings.items()}
    parameters = [part for name, value in values.items() for part in ("-p", f"{name}:={value}")]
    script = _script([executable, "--ros-args", *parameters])
    return ["bash", "-c", script], {**DEFAULTS, **os.environ}


def _script(command: Sequence[str]) -> str:
    """What a shell has to do to become this node."""
    prefix, setup = workspace(os.environ)
    executable, *arguments = command
    node = shlex.join([str(prefix / "lib" / "drs" / executable), *arguments])
    return f"exec {node}" if setup is None else f"source {shlex.quote(str(setup))} && exec {node}"


def workspace(environment: Mapping[str, str]) -> tuple[Path, Path | None]:
    """Where the package `drs` is installed, and what to source first, if anything.

    Raises:
        DrsError: it is not built, or not found.
    """
    for prefix in filter(None, environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        if (Path(prefix) / "lib" / "drs" / "tuner_node").exists():
            return Path(prefix), None
    built = _CHECKOUT / "ros_ws" / "install"
    if (built / "drs" / "lib" / "drs" / "tuner_node").exists():
        return built / "drs", built / "setup.bash"
    raise DrsError("The ROS 2 nodes are not built. Run make ros, or source the workspace's install/setup.bash.")
