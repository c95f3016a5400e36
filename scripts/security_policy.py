"""Writes ros_ws/security/policy.xml, who may do what in a graph with SROS2: python scripts/security_policy.py.

Who publishes a topic and who offers a service stand in the tables of docs/ros.md; who listens and who asks stand
below. A test compares the result with what running nodes really have.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE, TARGET = ROOT / "docs" / "ros.md", ROOT / "ros_ws" / "security" / "policy.xml"
VERSION = "0.2.0"
"""Of the schema: https://design.ros2.org/articles/ros2_access_control_policies.html."""

NODE_TOPICS = ("/rosout", "/parameter_events")
NODE_SERVICES = tuple(
    f"~/{name}"
    for name in (
        *("describe_parameters", "get_parameter_types", "get_parameters", "list_parameters"),
        *("set_parameters", "set_parameters_atomically", "get_type_description"),
    )
)
LIFECYCLE_SERVICES = tuple(
    f"~/{name}"
    for name in (
        "change_state",
        "get_state",
        "get_available_states",
        "get_available_transitions",
        "get_transition_graph",
    )
)
SIMULATOR, TUNER, POLICY, MOCK_ARM = "simulator", "tuner", "policy", "mock arm"
LISTENS: Mapping[str, tuple[str, ...]] = {
    SIMULATOR: ("action", "joint_command", "target_pose", "finger_command"),
    POLICY: ("observation", "joint_states", "end_effector/pose", "end_effector/twist", "goal_pose", "object_pose"),
    MOCK_ARM: ("joint_command", "joint_trajectory", "target_pose"),
}
GIVEN = ("goal_pose", "object_pose")
"""What an operator may publish."""


@dataclass(frozen=True)
class Profile:
    """What one node may do; names as ROS resolves them, ``~`` the node's own."""

    node: str
    publish: tuple[str, ...] = ()
    subscribe: tuple[str, ...] = ()
    reply: tuple[str, ...] = ()
    request: tuple[str, ...] = ()
    execute: tuple[str, ...] = ()
    call: tuple[str, ...] = ()

    def rules(self) -> Iterable[tuple[str, str, tuple[str, ...]]]:
        """(kind, permission, names)."""
        yield "topic", "publish", self.publish
        yield "topic", "subscribe", self.subscribe
        yield "service", "reply", self.reply
        yield "service", "request", self.request
        yield "action", "execute", self.execute
        yield "action", "call", self.call


@dataclass(frozen=True)
class Tables:
    """What docs/ros.md says: topics by publisher, services and actions by server."""

    topics: dict[str, list[str]] = field(default_factory=dict)
    services: dict[str, list[str]] = field(default_factory=dict)
    actions: dict[str, list[str]] = field(default_factory=dict)


def tables(page: str) -> Tables:
    """Read the two tables of the page."""
    found = Tables()
    for line in page.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        names = re.findall(r"`([~/\w]+)`", cells[0])
        if not names or len(cells) not in (3, 4):
            continue
        if len(cells) == 4 and re.match(r"\w+/\w", cells[1]):
            for node in cells[2].split(", "):
                found.topics.setdefault(node, []).extend(names)
        elif len(cells) == 3 and re.match(r"\w+/(srv|action|Trigger)", cells[1]):
            kind = found.actions if "/action/" in cells[1] else found.services
            node = re.match(r"simulator|tuner|policy|mock arm", cells[2])
            if node:
                kind.setdefault(node[0], []).extend(names)
    return found


def enclaves(page: str, simulators: int) -> dict[str, list[Profile]]:
    """Enclave path -> profiles of the nodes in it."""
    read = tables(page)

    def profile(role: str, node: str, **more: tuple[str, ...]) -> Profile:
        extra = {name: values for name, values in more.items() if name not in ("reply", "publish")}
        return Profile(
            node,
            publish=(*NODE_TOPICS, *read.topics.get(role, ()), *more.get("publish", ())),
            subscribe=LISTENS.get(role, ()),
            reply=(*NODE_SERVICES, *read.services.get(role, ()), *more.get("reply", ())),
            **extra,
        )

    # all but the first have no topics of their own
    first = profile(SIMULATOR, "simulator_node")
    others = [
        replace(first, node=f"simulator_{i}", publish=NODE_TOPICS, subscribe=()) for i in range(2, simulators + 1)
    ]
    asked = tuple(
        f"/*/{name[2:]}" for name in read.services[SIMULATOR] if name.endswith(("agent", "vector", "episodes"))
    )
    actions = tuple(read.actions[TUNER])
    profiles = {
        "/drs/simulator": [first, *others],
        "/drs/tuner": [profile(TUNER, "tuner_node", request=asked, execute=actions)],
        "/drs/policy": [
            profile(POLICY, "policy_node", reply=LIFECYCLE_SERVICES, publish=("~/transition_event",)),
        ],
        "/drs/mock_arm": [profile(MOCK_ARM, "mock_arm_node")],
        "/drs/recorder": [Profile("recorder_node", publish=NODE_TOPICS, subscribe=("/*",), reply=NODE_SERVICES)],
    }
    return profiles | {"/drs/operator": [operator(profiles, actions)]}


def operator(profiles: Mapping[str, list[Profile]], actions: tuple[str, ...]) -> Profile:
    """Whoever sits at the command line: sees all, gives goals, asks every service of every node."""
    asked = [name.replace("~", f"/{p.node}", 1) for nodes in profiles.values() for p in nodes for name in p.reply]
    return Profile(
        "operator",
        publish=(*NODE_TOPICS, *GIVEN),
        subscribe=("/*",),
        # of the command line's own nodes, whose names begin so
        reply=tuple(f"/_ros2cli*/{name[2:]}" for name in NODE_SERVICES),
        request=tuple(name if name.startswith("/") else f"/{name}" for name in dict.fromkeys(asked)),
        call=actions,
    )


def policy(page: str, simulators: int = 2) -> str:
    """The whole file."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        "<!-- Written by scripts/security_policy.py; see docs/security.md. -->",
    ]
    lines += [f'<policy version="{VERSION}">', "  <enclaves>"]
    for path, profiles in enclaves(page, simulators).items():
        lines += [f'    <enclave path="{path}">', "      <profiles>"]
        for profile in profiles:
            lines.append(f'        <profile ns="/" node="{profile.node}">')
            for kind, permission, names in profile.rules():
                if names:
                    lines.append(f'          <{kind}s {permission}="ALLOW">')
                    lines += [f"            <{kind}>{name}</{kind}>" for name in dict.fromkeys(names)]
                    lines.append(f"          </{kind}s>")
            lines.append("        </profile>")
        lines += ["      </profiles>", "    </enclave>"]
    return "\n".join([*lines, "  </enclaves>", "</policy>", ""])


def main() -> None:
    """Write the file, or one for more simulators elsewhere."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--simulators", type=int, default=2, help="as drs graph names them")
    options.add_argument("--output", type=Path, default=TARGET)
    given = options.parse_args()
    given.output.write_text(policy(PAGE.read_text(), given.simulators))


if __name__ == "__main__":
    main()
