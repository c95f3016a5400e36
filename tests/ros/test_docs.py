"""The page on the graph is what its generators make, and names what is there."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from typing import Any

from tests.ros.graph import ROOT, Graph

PAGE = (ROOT / "docs" / "ros.md").read_text()


def script(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / f"{name}.py")
    # where dataclasses look for the module of a class
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_picture_is_the_newest() -> None:
    drawn = script("graph_picture")
    assert drawn.TARGET.read_text() == drawn.picture()


def test_the_tables_of_parameters_are_the_newest() -> None:
    for node, text in script("parameter_tables").tables().items():
        assert text in PAGE, node


def test_every_interface_of_the_page_exists_and_has_comments() -> None:
    folder = ROOT / "ros_ws" / "src" / "drs_interfaces"
    for kind, name in re.findall(r"drs_interfaces/(srv|action)/(\w+)", PAGE):
        assert (folder / kind / f"{name}.{kind}").exists()
    for path in [p for kind in ("msg", "srv", "action") for p in folder.glob(f"{kind}/*")]:
        for line in path.read_text().splitlines():
            assert not line.strip() or line == "---" or "#" in line or "=" in line, (path.name, line)


def python(page: str, begin: str) -> str:
    (block,) = re.findall(rf"```python\n({begin}.*?)```", page, re.DOTALL)
    return block


def test_a_few_lines_of_python_do_without_the_ros2_command(graph: Graph, tmp_path: Path) -> None:
    asking, arm = python(PAGE, "import rclpy"), python((ROOT / "docs" / "arm.md").read_text(), "from geometry_msgs")
    graph.environment["PYTHONUNBUFFERED"] = "1"
    program = tmp_path / "ask.py"
    program.write_text(asking)
    graph.start("simulator_node", stream=False)
    graph.start_ready("tuner_node")
    policy = graph.start_ready("policy_node", autoconfigure=True)
    node = graph.start(str(program), "ask")
    graph.wait(lambda: node.process.poll() is not None, "its end")
    answers = node.log.read_text().splitlines()
    assert node.process.returncode == 0 and len(answers) == 3, answers
    assert "success=True" in answers[0] and "episodes=20" in answers[0]
    assert "success=True" in answers[1] and policy.said("active")
    assert "success=False" in answers[2] and "Nothing is paused" in answers[2]

    policy.interrupt()
    graph.start_ready("mock_arm_node")
    graph.start_ready("policy_node", input="arm", autoconfigure=True)
    program.write_text(re.sub(r"^ask\(.*\n", "", asking, flags=re.MULTILINE) + arm)
    moving = graph.start(str(program), "ask")
    graph.wait(lambda: moving.said("state=2"), "motion")
