"""The network does what it is told: addresses, delay, loss, a cut, multicast."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from tests.network.frames import BROADCAST, Forwarding, Impairment
from tests.network.hosts import Host, Network
from tests.ros.graph import ROOT

GROUP = "239.255.0.1"
_ECHO = """
import socket
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
s.bind(("", 9000))
member = socket.inet_aton("239.255.0.1") + socket.inet_aton("{address}")
s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
print("up", flush=True)
while True:
    s.sendto(*s.recvfrom(65536))
"""
_PING = """
import json, socket, time
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
s.settimeout({patience_s})
times = []
for number in range({count}):
    start = time.monotonic()
    s.sendto(b"x" * {size}, ("{to}", 9000))
    try:
        s.recvfrom(65536)
    except TimeoutError:
        continue
    times.append(time.monotonic() - start)
print(json.dumps(times))
"""


@pytest.fixture(scope="module")
def wire(network_of_three: Network) -> Iterator[Network]:
    """A network whose second and third host answer every datagram."""
    echoes = [_start(host, _ECHO.format(address=host.address)) for host in network_of_three.hosts[1:]]
    for echo in echoes:
        assert echo.stdout.readline() == b"up\n"
    yield network_of_three
    for echo in echoes:
        os.killpg(echo.pid, signal.SIGKILL)
        echo.communicate()


def _start(host: Host, program: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [*host.inside, sys.executable, "-c", program], stdout=subprocess.PIPE, start_new_session=True
    )


def ping(wire: Network, to: str, count: int, patience_s: float = 0.2, size: int = 8) -> list[float]:
    """Durations of the round trips from the first host that came back [s]."""
    ping = _start(wire.hosts[0], _PING.format(to=to, count=count, patience_s=patience_s, size=size))
    return json.loads(ping.communicate(timeout=30)[0])


def test_a_round_trip_takes_two_delays(wire: Network) -> None:
    wire.impair()
    assert len(ping(wire, "10.77.0.2", 20)) == 20
    wire.impair(delay_s=0.02)
    times = ping(wire, "10.77.0.3", 20, 1.0)
    assert len(times) == 20 and min(times) >= 0.04
    wire.impair()


def test_a_host_that_is_cut_off_is_not_reached_and_then_again(wire: Network) -> None:
    wire.impair(cut=[1])
    assert ping(wire, "10.77.0.2", 3) == []
    assert len(ping(wire, "10.77.0.3", 3)) == 3
    wire.impair()
    assert len(ping(wire, "10.77.0.2", 3)) == 3


def test_multicast_is_forwarded_or_blocked(wire: Network) -> None:
    wire.impair()
    assert len(ping(wire, GROUP, 3)) == 3
    before = wire.impair(multicast=False)
    assert ping(wire, GROUP, 3) == []
    assert wire.impair().blocked >= before.blocked + 3


def test_a_large_datagram_is_many_frames_and_the_loss_of_one_is_the_loss_of_all(wire: Network) -> None:
    before = wire.impair()
    assert len(ping(wire, "10.77.0.2", 1, size=60000)) == 1
    after = wire.impair()
    assert after.sent - before.sent >= 80 and after.unicast[1][0] - before.unicast[1][0] > 60000


@pytest.mark.parametrize("loss", [0.0, 0.02, 0.5, 1.0])
def test_frames_are_lost_as_often_as_it_says_each_on_its_own(loss: float) -> None:
    forwarding = Forwarding(3, seed=1)
    forwarding.impairment = Impairment(loss=loss)
    frame = BROADCAST + b"\x02\0\0\0\0\x01" + b"\0" * 50
    arrived = [port for _ in range(5000) for port in forwarding.destinations(0, frame)]
    for port in (1, 2):
        assert abs(arrived.count(port) / 5000 - (1.0 - loss)) < 0.03
    assert 0 not in arrived and forwarding.counts.lost == 10000 - len(arrived)


def test_an_address_is_learned() -> None:
    forwarding, ours, other = Forwarding(3, seed=1), b"\x02\0\0\0\0\x01", b"\x02\0\0\0\0\x02"
    body = b"\0" * 50
    assert forwarding.destinations(0, other + ours + body) == [1, 2]
    assert forwarding.destinations(2, ours + other + body) == [0]
    assert forwarding.destinations(0, other + ours + body) == [2]
    assert forwarding.destinations(1, b"short") == []


MAKER = """
from tests.network.hosts import network
with network(2) as made:
    print(made.hosts[0].pid, flush=True)
    input()
"""


def test_hosts_go_also_where_their_maker_is_killed(wire: Network) -> None:
    pipe = subprocess.PIPE
    maker = subprocess.Popen([sys.executable, "-c", MAKER], cwd=ROOT, stdin=pipe, stdout=pipe)
    enter = ["nsenter", f"--target={int(maker.stdout.readline())}", "--net", "true"]
    assert subprocess.run(enter).returncode == 0
    maker.kill()
    maker.communicate()
    end = time.monotonic() + 10
    while subprocess.run(enter, capture_output=True).returncode == 0:
        assert time.monotonic() < end, "the host lives on"
        time.sleep(0.05)
