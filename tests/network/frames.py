"""What a switch does with an Ethernet frame: where it goes, how late, and whether it is lost."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

BROADCAST = b"\xff" * 6
_FRAME_MIN = 14


@dataclass(frozen=True)
class Impairment:
    """How bad the network is.

    Attributes:
        delay_s: from port to port; a round trip takes twice as long.
        loss: probability in [0, 1] that a frame does not arrive, drawn for each of its destinations.
        cut: ports that nothing leaves or reaches.
        multicast: whether frames to groups are forwarded; broadcast is, always, since ARP needs it.
    """

    delay_s: float = 0.0
    loss: float = 0.0
    cut: tuple[int, ...] = ()
    multicast: bool = True

    def __post_init__(self) -> None:
        if not 0.0 <= self.loss <= 1.0 or self.delay_s < 0.0:
            raise ValueError(f"loss is {self.loss}, delay_s {self.delay_s}; allowed are 0 to 1, and 0 or more.")
        object.__setattr__(self, "cut", tuple(self.cut))


@dataclass
class Counts:
    """Frames so far, once for each destination; `unicast[j][i]` are the bytes that port j got from port i."""

    sent: int = 0
    lost: int = 0
    blocked: int = 0
    unicast: list[list[int]] = field(default_factory=list)


class Forwarding:
    """Learns which address is behind which port, and decides what happens to each frame."""

    def __init__(self, ports: int, seed: int) -> None:
        self.impairment = Impairment()
        self.counts = Counts(unicast=[[0] * ports for _ in range(ports)])
        self._ports, self._random = range(ports), random.Random(seed)
        self._learned: dict[bytes, int] = {}

    def destinations(self, source: int, frame: bytes) -> list[int]:
        """The ports that this frame arrives at."""
        if len(frame) < _FRAME_MIN:
            return []
        to, sender = frame[:6], frame[6:12]
        self._learned[sender] = source
        group = bool(to[0] & 1)
        if group and to != BROADCAST and not self.impairment.multicast:
            self.counts.blocked += 1
            return []
        known = None if group else self._learned.get(to)
        wanted = [port for port in self._ports if port != source] if known is None else [known]
        arriving = [port for port in wanted if self._arrives(source, port)]
        if known is not None:
            for port in arriving:
                self.counts.unicast[port][source] += len(frame)
        return arriving

    def _arrives(self, source: int, port: int) -> bool:
        if source in self.impairment.cut or port in self.impairment.cut:
            self.counts.blocked += 1
            return False
        self.counts.sent += 1
        if self._random.random() < self.impairment.loss:
            self.counts.lost += 1
            return False
        return True
