"""Hosts that are namespaces of this machine, and the network between them.

A host has network interfaces, a process table and a /dev/shm of its own, so processes on two hosts share
nothing but the switch. It lives for as long as its first process, which waits for the end of its input: when
the process of the tests ends, however it ends, every host goes with all that runs on it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from typing import Any

from tests.network.frames import Counts, Impairment
from tests.network.switch import TUN
from tests.ros.graph import ROOT

TOOLS = ("ip", "mount", "nsenter", "unshare")
UNSHARE = ("unshare", "--net", "--mount", "--pid", "--fork", "--mount-proc")
_BEGIN = "mount -t tmpfs tmpfs /dev/shm && ip link set lo up && echo up && exec cat"
_JOIN = "ip address add {address}/24 brd + dev eth0 && ip link set eth0 up && ip route add default dev eth0"


def missing() -> str:
    """Why hosts cannot be made here; empty where they can."""
    absent = [tool for tool in TOOLS if not shutil.which(tool)]
    if absent:
        return f"no program {absent[0]}: install iproute2 and util-linux"
    if os.geteuid() != 0:
        return "network namespaces are root's: run these tests as root"
    if not os.path.exists(TUN):
        return f"no {TUN}: load the kernel's module tun"
    tried = subprocess.run([*UNSHARE, "true"], capture_output=True, text=True)
    return f"no namespaces here: {tried.stderr.strip()}" if tried.returncode else ""


@dataclass(frozen=True)
class Host:
    """One host: `number` is its port at the switch, `pid` that of its first process as seen from outside."""

    number: int
    pid: int

    @property
    def address(self) -> str:
        return f"10.77.0.{self.number + 1}"

    @property
    def inside(self) -> tuple[str, ...]:
        """What a command line on this host begins with."""
        # the process table is that of the children: unshare itself stays in the one outside
        table = f"--pid=/proc/{self.pid}/ns/pid_for_children"
        return ("nsenter", f"--target={self.pid}", "--net", "--mount", table, "--")


class Network:
    """Hosts at one switch."""

    def __init__(self, hosts: list[Host], switch: subprocess.Popen[bytes]) -> None:
        self.hosts, self._switch = hosts, switch

    def impair(self, **settings: Any) -> Counts:
        """From now on it is as `Impairment` says; gives what the switch has counted so far."""
        asked = json.dumps(asdict(Impairment(**settings)))
        self._switch.stdin.write(asked.encode() + b"\n")
        self._switch.stdin.flush()
        return Counts(**json.loads(self._switch.stdout.readline()))


@contextmanager
def network(hosts: int, seed: int = 0) -> Iterator[Network]:
    """So many hosts, 10.77.0.1 and on, at one switch."""
    with ExitStack() as stack:
        made = [_host(stack, number) for number in range(hosts)]
        # the last to be made, so the first to end: a device that it holds would outlive its namespace
        switch = _begin(stack, [sys.executable, "-m", "tests.network.switch", str(hosts), str(seed)])
        for host, device in zip(made, json.loads(switch.stdout.readline())):
            _run("ip", "link", "set", device, "netns", str(host.pid), "name", "eth0")
            _run(*host.inside, "sh", "-c", _JOIN.format(address=host.address))
        yield Network(made, switch)


def _host(stack: ExitStack, number: int) -> Host:
    first = _begin(stack, [*UNSHARE, "sh", "-c", _BEGIN])
    assert first.stdout.readline() == b"up\n"
    return Host(number, first.pid)


def _run(*command: str) -> None:
    subprocess.run(command, check=True)


def _begin(stack: ExitStack, command: list[str]) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    stack.callback(_end, process)
    return process


def _end(process: subprocess.Popen[bytes]) -> None:
    process.stdin.close()
    process.wait(timeout=10)
    process.stdout.close()
