"""Real nodes as processes in a domain of their own, and clients that wait until something holds."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import rclpy
from rcl_interfaces.srv import ListParameters
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import QoSProfile

ROOT = Path(__file__).resolve().parents[2]
NODES = ROOT / "ros_ws" / "install" / "drs" / "lib" / "drs"
SERVICE_DEPTH = QoSProfile(depth=200)
PATIENCE_S = 40.0
ENDING_S = 5.0


class NodeProcess:
    """One node, in a process group of its own; its output goes to a file. `inside` begins its command line."""

    def __init__(
        self,
        executable: str,
        name: str,
        parameters: dict[str, Any],
        log: Path,
        environment: dict[str, str],
        inside: tuple[str, ...] = (),
        remaps: Sequence[str] = (),
    ):
        settings = [f"-p{key}:={_value(value)}" for key, value in parameters.items()]
        split = [part for setting in settings for part in ("-p", setting[2:])]
        split += [part for rule in remaps for part in ("-r", rule)]
        # a node's own name is the executable's: only another one is said
        named = [] if name == executable else ["-r", f"__node:={name}"]
        self.log, self.name = log, name
        with open(log, "wb") as file:
            self.process = subprocess.Popen(
                [*inside, sys.executable, NODES / executable, "--ros-args", *named, *split],
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env=environment,
            )

    def said(self, text: str) -> bool:
        return text in self.log.read_text(errors="replace")

    def send(self, number: int) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, number)

    def interrupt(self) -> tuple[int, float]:
        """SIGINT, as Ctrl-C gives it; exit status and how long it took [s]."""
        start = time.monotonic()
        self.send(signal.SIGINT)
        status = self.process.wait(timeout=20)
        return status, time.monotonic() - start

    def kill(self) -> None:
        self.send(signal.SIGCONT)
        self.send(signal.SIGKILL)
        self.process.wait()

    @property
    def memory_mb(self) -> float:
        return psutil.Process(self.process.pid).memory_info().rss / 1e6


class Graph:
    """Nodes of one test, and a client node."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.folder = folder
        _remove_stale_locks(domain)
        self.environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(folder / "log")}
        self.nodes: list[NodeProcess] = []
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.client = rclpy.create_node("test_client", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.client)
        self._actions: list[ActionClient] = []

    def start(
        self, executable: str, name: str | None = None, remaps: Sequence[str] = (), **parameters: Any
    ) -> NodeProcess:
        name = name or executable
        log = self.folder / f"{name}.log"
        node = NodeProcess(executable, name, parameters, log, self.environment, remaps=remaps)
        self.nodes.append(node)
        return node

    def start_ready(self, executable: str, name: str | None = None, **parameters: Any) -> NodeProcess:
        node = self.start(executable, name, **parameters)
        self.wait(lambda: node.said("ready"), f"{node.name} to be ready")
        return node

    def wait(self, condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
        end = time.monotonic() + patience_s
        while not condition():
            logs = "\n".join(f"--- {n.name}\n{n.log.read_text()[-2000:]}" for n in self.nodes)
            assert time.monotonic() < end, f"waited {patience_s} s for {what}\n{logs}"
            self._executor.spin_once(timeout_sec=0.02)

    def call(
        self, kind: Any, name: str, request: Any = None, patience_s: float = PATIENCE_S, repeat_s: float = math.inf
    ) -> Any:
        """An answer of a server that knows the client, or to one of the requests that are repeated until then."""
        client = self.client.create_client(kind, name, qos_profile=SERVICE_DEPTH)
        self.wait(client.service_is_ready, f"service {name}")
        if math.isinf(repeat_s):
            self.become_known(self._offering(name))
        start, sent = time.monotonic(), [client.call_async(request or kind.Request())]

        def answered() -> bool:
            if time.monotonic() > start + repeat_s * len(sent):
                sent.append(client.call_async(request or kind.Request()))
            return any(future.done() for future in sent)

        self.wait(answered, f"an answer of {name}", patience_s)
        self.client.destroy_client(client)
        return next(future.result() for future in sent if future.done())

    def action(self, kind: Any, name: str, node: str) -> ActionClient:
        """A client that is ready and known to the node, and that `close` destroys before its own."""
        client = ActionClient(self.client, kind, name)
        self._actions.append(client)
        self.wait(client.server_is_ready, f"action {name}")
        self.become_known(node)
        return client

    def become_known(self, node: str) -> None:
        """Wait until this node knows the client made last: it loses an answer to one that it does not know yet.

        Clients are announced in the order in which they were made, so an answer to one made later proves it.
        """
        self.call(ListParameters, f"{node}/list_parameters", repeat_s=2.0)

    def _offering(self, service: str) -> str:
        """The node with this service, which may be announced after the service itself."""
        full, found = self.client.resolve_service_name(service), list[str]()

        def look() -> bool:
            for name, space in self.client.get_node_names_and_namespaces():
                # it may have ended in the meantime
                with suppress(NodeNameNonExistentError):
                    if full in dict(self.client.get_service_names_and_types_by_node(name, space)):
                        found.append(f"{space.rstrip('/')}/{name}")
            return bool(found)

        self.wait(look, f"a node with the service {full}")
        return found[0]

    def finish(self, future: Any, what: str) -> Any:
        self.wait(future.done, what)
        return future.result()

    def close(self) -> None:
        """End everything; may be called again."""
        if not self.context.ok():
            return
        self._end_nodes()
        self._executor.shutdown()
        for client in self._actions:
            client.destroy()
        self.client.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def _end_nodes(self) -> None:
        # Fast DDS 2.14, where it ends a participant, now and then crashes on the shared memory of peers
        # that were killed, so only what does not end by itself is
        for node in self.nodes:
            node.send(signal.SIGCONT)
            node.send(signal.SIGINT)
        end = time.monotonic() + ENDING_S
        while any(node.process.poll() is None for node in self.nodes) and time.monotonic() < end:
            time.sleep(0.01)
        for node in self.nodes:
            node.kill()


def _value(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value}"


def _remove_stale_locks(domain: int) -> None:
    """Fast DDS's shared memory keeps the locks of processes that earlier tests killed; a new one would hang on them.

    The domain is this test's alone, and so are the ports that follow from its number.
    """
    first = 7400 + 250 * domain
    for path in Path("/dev/shm").glob("*fastrtps_port*"):
        number = re.search(r"port(\d+)", path.name)
        if number and first <= int(number[1]) < first + 250:
            path.unlink(missing_ok=True)
