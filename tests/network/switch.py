"""A network switch in user space: `python -m tests.network.switch PORTS SEED`.

Each port is a TAP device, to be moved into a host's network namespace. The first line of the output is the
list of their names. Each line of the input is the network's new impairment as JSON, and answered with the
counts so far; the end of the input ends the switch, and with it go its devices.
"""

from __future__ import annotations

import fcntl
import heapq
import json
import os
import selectors
import struct
import sys
import time
from dataclasses import asdict

from tests.network.frames import Forwarding, Impairment

TUN = "/dev/net/tun"
_TUNSETIFF, _IFF_TAP, _IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
_FRAME_MAX = 65536


def open_tap() -> tuple[int, str]:
    """A new TAP device: the file whose reads and writes are frames, and its name."""
    file = os.open(TUN, os.O_RDWR | os.O_NONBLOCK)
    # the kernel puts the first free number for %d
    answer = fcntl.ioctl(file, _TUNSETIFF, struct.pack("16sH22x", b"drs%d", _IFF_TAP | _IFF_NO_PI))
    return file, answer[:16].rstrip(b"\0").decode()


class Switch:
    """Reads frames from every port and writes each, once its time has come, to those it goes to."""

    def __init__(self, ports: list[int], seed: int) -> None:
        self._ports, self._forwarding = ports, Forwarding(len(ports), seed)
        # the number keeps the order of frames that are due together
        self._due: list[tuple[float, int, int, bytes]] = []
        self._number = 0

    def run(self, commands: int) -> None:
        """Until there are no more commands."""
        selector = selectors.DefaultSelector()
        for place, file in enumerate(self._ports):
            selector.register(file, selectors.EVENT_READ, place)
        selector.register(commands, selectors.EVENT_READ)
        while True:
            wait_s = max(0.0, self._due[0][0] - time.monotonic()) if self._due else None
            for key, _ in selector.select(wait_s):
                if key.fd != commands:
                    self._take(key.data)
                elif not self._obey(commands):
                    return
            self._deliver()

    def _obey(self, commands: int) -> bool:
        line = os.read(commands, _FRAME_MAX)
        if line:
            self._forwarding.impairment = Impairment(**json.loads(line))
            print(json.dumps(asdict(self._forwarding.counts)), flush=True)
        return bool(line)

    def _take(self, source: int) -> None:
        try:
            frame = os.read(self._ports[source], _FRAME_MAX)
        except OSError:
            # the device is not up yet, or no longer
            return
        due = time.monotonic() + self._forwarding.impairment.delay_s
        for port in self._forwarding.destinations(source, frame):
            self._number += 1
            heapq.heappush(self._due, (due, self._number, port, frame))

    def _deliver(self) -> None:
        while self._due and self._due[0][0] <= time.monotonic():
            _, _, port, frame = heapq.heappop(self._due)
            try:
                os.write(self._ports[port], frame)
            except OSError:
                continue


def main() -> None:
    """Run until the end of the input."""
    taps = [open_tap() for _ in range(int(sys.argv[1]))]
    print(json.dumps([name for _, name in taps]), flush=True)
    Switch([file for file, _ in taps], int(sys.argv[2])).run(sys.stdin.fileno())


if __name__ == "__main__":
    main()
