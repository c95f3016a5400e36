"""`scripts/smooth_motion.py`: searches and their controls on the same episodes, kept and continued."""

import csv
import io
import subprocess
import sys

import numpy as np
import pytest
from smooth_motion import times

from drs_core.agent import load
from tests.conftest import make_agent


def test_rows_of_a_small_study_and_of_the_same_again(tmp_path):
    make_agent().save(tmp_path / "car.safetensors")
    tune = ("--updates", "2", "--directions", "2")
    command = [sys.executable, "scripts/smooth_motion.py", tmp_path / "car.safetensors", "--runs", tmp_path / "runs"]

    def study(episodes, seeds=1):
        more = ("--seeds", seeds, "--draws", 2, "--episodes", episodes, "--", *tune)
        result = subprocess.run([*map(str, (*command, *more))], capture_output=True, text=True, timeout=300)
        assert result.returncode == 0, result.stderr
        return list(csv.DictReader(io.StringIO(result.stdout)))

    first = study(3)
    assert [(row["kind"], row["seed"]) for row in first] == [
        *(("smooth", "0"), ("return", "0"), ("random", "0"), ("random", "1")),
    ]
    smooth, _, one, other = first
    assert len({row["return_before"] for row in first}) == 1
    assert smooth["distance"] == one["distance"] == other["distance"]
    assert one["return_after"] != other["return_after"]
    (folder,) = (tmp_path / "runs").iterdir()
    moves = [load(folder / f"random-{draw}.safetensors").theta for draw in range(2)]
    start = load(tmp_path / "car.safetensors").theta
    for theta in moves:
        assert np.linalg.norm(theta - start) == pytest.approx(float(smooth["distance"]), rel=1e-4)
    assert study(3) == first
    # nothing kept stands for what it is not: neither other episodes nor random moves of another length
    assert study(4)[0]["return_before"] != smooth["return_before"]
    longer = study(3, seeds=2)
    assert longer[0] == smooth
    assert longer[4]["distance"] != one["distance"] and longer[4]["return_after"] != one["return_after"]


def test_gains_by_hand_halve_every_action():
    start = make_agent()
    whole, half = start.policy(), times(start, 0.5).policy()
    rng, inside = np.random.default_rng(0), 0
    for features in rng.normal(0, 0.3, (50, start.pipeline.size)).astype(np.float32):
        action = whole.act(features)
        if abs(action) < 1.0:
            assert half.act(features) == pytest.approx(0.5 * action, rel=1e-5)
            inside += 1
    assert inside > 10
