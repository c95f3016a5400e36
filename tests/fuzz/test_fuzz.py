"""Wild inputs to everything that is read from elsewhere: a result or a sentence, soon, in bounds, in its folder.

The short form tries fixed inputs. The long form goes on for DRS_FUZZ_MINUTES a target (default 8), from
DRS_FUZZ_SEED (default: of the clock), and prints what it tried; a find names what makes its input again:
python -m tests.fuzz.campaign TARGET --seed SEED --first INPUT --inputs 1.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.fuzz.guards import MEMORY_LIMIT, TIME_LIMIT_S
from tests.fuzz.targets import TARGETS

ROOT = Path(__file__).resolve().parents[2]
NAMES = (*TARGETS, "messages")
SHORT = {"agent": 400, "zoo": 80, "pickle": 1500, "yaml": 150, "recording": 300, "run_folder": 80, "messages": 1500}


def campaign(name: str, *options: str, patience_s: float = 120.0) -> dict[str, Any]:
    """A campaign in a process of its own; a crash of the interpreter shows as its exit status."""
    if name == "messages" and any(find_spec(module) is None for module in ("rclpy", "drs_interfaces", "drs")):
        pytest.skip("no ROS 2 here: build the workspace (make ros) and source ros_ws/install/setup.bash")
    command = [sys.executable, "-m", "tests.fuzz.campaign", name, *options]
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=patience_s, env=environment)
    assert done.returncode == 0, f"{name} ended with {done.returncode}: {done.stderr[-3000:]}"
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    print({key: value for key, value in found.items() if key != "finds"})
    return found


def without_finds(found: dict[str, Any]) -> None:
    """Nothing was wrong, and the inputs were neither all valid nor all hopeless."""
    assert not found["finds"], "\n\n".join(
        f"input {f['input']} of seed {f['seed']}: {f['find']}" for f in found["finds"]
    )
    assert 0 < found["taken"] < found["inputs"]
    assert found["slowest_s"] <= TIME_LIMIT_S + 0.5


@pytest.mark.parametrize("name", NAMES)
def test_wild_inputs_give_a_result_or_a_sentence(name: str) -> None:
    without_finds(campaign(name, "--inputs", str(SHORT[name])))


@pytest.mark.soak
@pytest.mark.timeout(0)
@pytest.mark.parametrize("name", NAMES)
def test_many_wild_inputs(name: str) -> None:
    minutes = float(os.environ.get("DRS_FUZZ_MINUTES", "8"))
    seed = os.environ.get("DRS_FUZZ_SEED", str(int(time.time())))
    without_finds(campaign(name, "--minutes", str(minutes), "--seed", seed, patience_s=60 * minutes + 300))


def test_the_guards_see_what_they_are_for(tmp_path: Any) -> None:
    code = f"""
import os, pickle, subprocess
from pathlib import Path
from tests.fuzz.guards import MEMORY_LIMIT, TooSlow, Watch, limit_memory, time_limit
folder, outside = Path({str(tmp_path)!r}) / "in", Path({str(tmp_path)!r}) / "out"
folder.mkdir()
(folder / "link").symlink_to(outside)
watch = Watch(folder)
def seen(act):
    try:
        act()
    except OSError:
        pass
    return watch.take()
assert not seen(lambda: (folder / "fine").write_text("x"))
assert not seen(lambda: (folder / "fine").unlink())
assert seen(lambda: outside.write_text("x"))
assert seen(lambda: (folder / "link").write_text("x"))
assert seen(lambda: (folder / ".." / "other").mkdir())
assert seen(lambda: os.rename(outside, folder / "y"))
assert seen(lambda: subprocess.run(["true"]))
assert seen(lambda: pickle.loads(b"cos\\ngetcwd\\n."))
assert seen(lambda: exec(compile("1", "elsewhere.py", "exec")))
limit_memory()
try:
    bytearray(MEMORY_LIMIT + 2**26)
    raise SystemExit("no limit of memory")
except MemoryError:
    pass
try:
    with time_limit(0.1):
        while True:
            try:
                sum(range(1000))
            except Exception:
                pass
except TooSlow:
    print("all seen")
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.stdout == "all seen\n", done.stderr
    assert MEMORY_LIMIT < 2**30
