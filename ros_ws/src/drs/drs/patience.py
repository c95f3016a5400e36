"""How long a tuner waits, and what it says meanwhile."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from drs.fleet import Link
from drs_core.errors import DrsError


@dataclass(frozen=True)
class Patience:
    """How long to wait.

    Attributes:
        call_deadline_s: for the answer to one call; after it the simulator is taken for hung.
        report_period_s: between two lines that say that no simulator is there.
        no_simulator_s: without any simulator, before giving up.
    """

    call_deadline_s: float = 30.0
    report_period_s: float = 5.0
    no_simulator_s: float = float("inf")


class Alone:
    """For how long no simulator has been able to take part."""

    def __init__(self, patience: Patience) -> None:
        """It begins now."""
        self._patience = patience
        self._since = self._said = time.monotonic()

    def look(self, links: Sequence[Link]) -> str:
        """What to say now about these, all whose services are there; mostly nothing.

        Raises:
            DrsError: none of them has been able for longer than the patience.
        """
        now = time.monotonic()
        # one that was refused is able again once it holds what it is sent, not when it may only be asked again
        if any(not link.refusal for link in links):
            self._since = now
            return ""
        why = (
            f"{links[0].name} cannot take part: {links[0].refusal}"
            if links
            else "start one: ros2 run drs simulator_node"
        )
        if now - self._since > self._patience.no_simulator_s:
            raise DrsError(f"No simulator for {self._patience.no_simulator_s:g} s; {why}")
        if now - self._said <= self._patience.report_period_s:
            return ""
        self._said = now
        return f"Waiting for a simulator; {why}"
