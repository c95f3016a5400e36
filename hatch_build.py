"""Compiles the accelerator's helper when the package is installed or a wheel is built.

Without a C compiler, or on another kind of machine, the package is the same without it.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDER = "drs_core/accelerator"


class CompileHelper(BuildHookInterface[Any]):
    """The build hook."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile into the source tree, and put the result into the wheel."""
        builder = _builder(Path(self.root) / FOLDER / "build.py")
        try:
            helper = builder.build()
        except builder.NotBuilt as reason:
            self.app.display_warning(f"Without the accelerator: {reason}.")
            return
        build_data["artifacts"].append(f"/{FOLDER}/{helper.name}")
        build_data["pure_python"] = False
        build_data["tag"] = "py3-none-linux_x86_64"


def _builder(path: Path) -> ModuleType:
    # by its path: the package cannot be imported before it is installed
    spec = importlib.util.spec_from_file_location("drs_accelerator_build", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
