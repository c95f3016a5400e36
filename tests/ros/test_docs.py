"""The page on the graph is what its generators make, and names what is there."""

from __future__ import annotations

import importlib.util
import re
import sys
from typing import Any

from tests.ros.graph import ROOT

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
