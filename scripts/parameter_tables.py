"""Prints the tables of node parameters of docs/ros.md, from the nodes' own declarations."""

from __future__ import annotations

from collections.abc import Sequence

from drs.declare import Declared
from drs.mock_arm_node import PARAMETERS as MOCK_ARM
from drs.policy_node import PARAMETERS as POLICY
from drs.recorder_node import PARAMETERS as RECORDER
from drs.simulator_node import PARAMETERS as SIMULATOR
from drs.tuner_parameters import PARAMETERS as TUNER


def table(parameters: Sequence[Declared]) -> str:
    """Markdown: name, default, meaning."""
    rows = ["| parameter | default | meaning |", "|---|---|---|"]
    for p in parameters:
        default = str(p.default).lower() if isinstance(p.default, bool) else f"{p.default}" or '""'
        allowed = f" One of {', '.join(p.allowed)}." if p.allowed else ""
        rows.append(f"| `{p.name}` | `{default}` | {p.description}.{allowed} |".replace(" | One", " \\| One"))
    return "\n".join(rows)


def nodes() -> dict[str, Sequence[Declared]]:
    """Node name -> its parameters."""
    return {
        "simulator_node": SIMULATOR,
        "tuner_node": TUNER,
        "policy_node": POLICY,
        "mock_arm_node": MOCK_ARM,
        "recorder_node": RECORDER,
    }


def tables() -> dict[str, str]:
    """Node name -> table."""
    return {node: table(parameters) for node, parameters in nodes().items()}


if __name__ == "__main__":
    for node, text in tables().items():
        print(f"### {node}\n\n{text}\n")
