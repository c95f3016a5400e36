"""What a benchmark ran on."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import psutil

import drs_core

PACKAGES = (
    "numpy",
    "gymnasium",
    "pybullet",
    "pybullet-envs-gymnasium",
    "panda-gym",
    "box2d",
    "torch",
    "stable-baselines3",
    "sb3-contrib",
    "evotorch",
    "numba",
)


def machine() -> dict[str, Any]:
    """Processor, cores that this process may use, memory, Python and the versions of what is compared."""
    return {
        "processor": processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_gb": round(psutil.virtual_memory().total / 1e9, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": {"drs": drs_core.__version__} | {name: found for name in PACKAGES if (found := _version(name))},
    }


def processor() -> str:
    """The processor's name, as the system tells it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
