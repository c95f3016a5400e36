import json
import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors.numpy import save

from drs_core.agent import load
from drs_core.errors import DrsError, UsageError


def edited(agent, path, change):
    """The agent's file with its header metadata changed by `change`."""
    content = agent.to_bytes()
    size = struct.unpack("<Q", content[:8])[0]
    header = json.loads(content[8 : 8 + size])
    metadata = json.loads(header["__metadata__"]["drs"])
    change(metadata, header)
    header["__metadata__"]["drs"] = json.dumps(metadata)
    packed = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(packed)) + packed + content[8 + size :])
    return path


def test_an_agent_comes_back_as_it_was_and_the_same_agent_gives_the_same_bytes(agent, tmp_path):
    path = tmp_path / "agent.safetensors"
    agent.save(path)
    again = load(path)
    assert again.to_bytes() == agent.to_bytes() == path.read_bytes()
    assert again.digest() == agent.digest()
    assert again.theta.tobytes() == agent.theta.tobytes()
    assert [p.name for p in tmp_path.iterdir()] == ["agent.safetensors"]


def test_the_digest_is_of_what_the_agent_does(agent):
    other = agent.theta.copy()
    other[3] += 1e-6
    assert agent.with_theta(other, ()).digest() != agent.digest()
    assert agent.with_theta(agent.theta, ({"seed": 1},)).digest() == agent.digest()


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_damaged_file_loads_as_the_same_agent_or_is_refused_with_a_sentence(agent, tmp_path, data):
    content = bytearray(agent.to_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "x.safetensors"
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    try:
        assert np.isfinite(load(path).theta).all()
    except UsageError as error:
        assert 10 < len(str(error)) < 600


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda m, h: m.update(format=2), "format 2"),
        (lambda m, h: m["network"].update(sizes=[2, 9, 1]), "policy.0.weight"),
        (lambda m, h: m["network"].update(sizes=[2, 10**12, 1]), "Layer sizes"),
        (lambda m, h: m["network"].update(activation="os.system"), "os.system"),
        (lambda m, h: m["network"].update(sizes="ab"), "sizes"),
        (lambda m, h: m["observation"].update(clip=-1.0), "clip"),
        (lambda m, h: m["observation"].update(clip=True), "clip"),
        (lambda m, h: m["observation"].update(clip=10**400), "clip"),
        (lambda m, h: m["observation"].update(time_limit_steps=0), "Time limit"),
        (lambda m, h: m.pop("environment"), "environment"),
        (lambda m, h: m["observation"]["parts"].clear(), "parts"),
    ],
)
def test_metadata_that_does_not_fit_is_refused(agent, tmp_path, change, word):
    with pytest.raises(UsageError, match=word):
        load(edited(agent, tmp_path / "x.safetensors", change))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_weights_that_are_not_finite_are_refused(agent, value):
    theta = agent.theta.copy()
    theta[0] = value
    with pytest.raises(UsageError, match="1 of the policy's"):
        agent.with_theta(theta, ())


def test_other_files_are_refused(tmp_path):
    path = tmp_path / "x.safetensors"
    for content, word in [(b"", "not an agent"), (save({"a": np.zeros(2)}), "no drs agent"), (b"\x80\x04.", "not an")]:
        path.write_bytes(content)
        with pytest.raises(UsageError, match=word):
            load(path)
    with pytest.raises(UsageError, match="is a folder and no agent file"):
        load(tmp_path)
    with pytest.raises(UsageError, match="There is no agent file"):
        load(tmp_path / "absent.safetensors")


def test_a_file_that_cannot_be_written_leaves_the_old_one(agent, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(DrsError, match="Cannot write"):
        agent.save(blocked / "agent.safetensors")
    target = tmp_path / "agent.safetensors"
    target.mkdir()
    with pytest.raises(DrsError, match="Cannot write"):
        agent.save(target)
    assert target.is_dir() and sorted(p.name for p in tmp_path.iterdir()) == ["agent.safetensors", "file"]
