"""Small agents trained by this project, shipped with the package; README.md beside says how."""

from __future__ import annotations

from pathlib import Path

from drs_core.agent import SUFFIX

FOLDER = Path(__file__).parent


def shipped() -> dict[str, Path]:
    """Name -> agent file of every shipped agent."""
    return {path.stem: path for path in sorted(FOLDER.glob(f"*{SUFFIX}"))}
