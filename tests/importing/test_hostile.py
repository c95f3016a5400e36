"""Damaged and hostile files, through the command line: a sentence, nothing run, nothing written."""

import io
import json
import os
import pickle
import shutil
import zipfile

import numpy as np
import pytest

from drs_core.errors import UsageError
from drs_core.importing import Hints, import_agent
from drs_core.importing.normaliser import read_normaliser
from tests.conftest import drs, refused


class Evil:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def rewritten(zip_file, target, **members):
    """A copy of a zip with members replaced (None: left out)."""
    with zipfile.ZipFile(zip_file) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = members.pop(name.replace(".", "_"), old.read(name))
            if content is not None:
                new.writestr(name, content)
        for name, content in members.items():
            new.writestr(name, content)
    return target


@pytest.fixture
def hopper(shared, tmp_path):
    """A private copy of a zoo folder."""
    folder = tmp_path / "a2c" / "HopperBulletEnv-v0_1"
    shutil.copytree(shared / "agents/a2c/HopperBulletEnv-v0_1", folder)
    for path in folder.rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)
    return folder


@pytest.fixture
def hopper_zip(hopper):
    return hopper / "HopperBulletEnv-v0.zip"


def data_of(zip_file):
    with zipfile.ZipFile(zip_file) as archive:
        return json.loads(archive.read("data"))


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"not a zip at all" * 50, os.urandom(5000)])
def test_files_that_are_no_zip(tmp_path, content):
    path, output = tmp_path / "HopperBulletEnv-v0.zip", tmp_path / "out.safetensors"
    path.write_bytes(content)
    refused(drs("import", path, "-o", output), "HopperBulletEnv-v0.zip")
    assert not output.exists()


def test_a_truncated_zip_and_a_truncated_member(hopper_zip, tmp_path):
    whole = hopper_zip.read_bytes()
    for size in (1000, len(whole) // 2, len(whole) - 1):
        hopper_zip.write_bytes(whole[:size])
        with pytest.raises(UsageError, match="HopperBulletEnv"):
            import_agent(str(hopper_zip.parent))
    hopper_zip.write_bytes(whole)
    with zipfile.ZipFile(hopper_zip) as archive:
        weights = archive.read("policy.pth")
    with pytest.raises(UsageError, match=r"policy\.pth"):
        import_agent(str(rewritten(hopper_zip, tmp_path / "HopperBulletEnv-v0.zip", policy_pth=weights[:5000])))


def test_every_byte_of_the_zip_may_be_wrong(hopper_zip):
    whole, rng = hopper_zip.read_bytes(), np.random.default_rng(0)
    for _ in range(300):
        content = bytearray(whole)
        for position in rng.integers(0, len(content), 20):
            content[position] = rng.integers(256)
        hopper_zip.write_bytes(content)
        try:
            assert np.isfinite(import_agent(str(hopper_zip.parent)).theta).all()
        except UsageError as error:
            assert len(str(error)) < 700


def test_a_zip_bomb(hopper_zip, tmp_path):
    bomb = tmp_path / "HopperBulletEnv-v0.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("data", b" " * 50_000_000)
    refused(drs("import", bomb, "-o", tmp_path / "o.safetensors"), "refused", "50000000 bytes")
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", b"\x80\x02}q\x00.")
        archive.writestr("archive/data/0", bytes(100_000_000))
    with pytest.raises(UsageError, match="refused"):
        import_agent(str(rewritten(hopper_zip, bomb, policy_pth=inner.getvalue())))


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "a/../../evil", "..\\evil"])
def test_names_outside_the_archive(hopper_zip, tmp_path, name):
    path = rewritten(hopper_zip, tmp_path / "HopperBulletEnv-v0.zip", **{name: b"x"})
    refused(drs("import", path, "-o", tmp_path / "o.safetensors"), "points outside")


def test_pickles_that_would_run_code(hopper, hopper_zip, tmp_path):
    made = tmp_path / "made"
    evil = pickle.dumps(Evil(made))
    normaliser = hopper / "HopperBulletEnv-v0" / "vecnormalize.pkl"
    kept = normaliser.read_bytes()
    normaliser.write_bytes(evil)
    refused(
        drs("import", hopper, "-o", tmp_path / "o.safetensors"), "vecnormalize.pkl", "mkdir", "nothing of it was run"
    )
    # hidden in an otherwise good one: before its last opcode, push and drop the evil object
    normaliser.write_bytes(kept[:-1] + evil[2:-1] + b"0.")
    with pytest.raises(UsageError, match="mkdir"):
        import_agent(str(hopper))
    normaliser.write_bytes(kept)
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        archive.writestr("archive/data.pkl", evil)
    with pytest.raises(UsageError, match="mkdir"):
        import_agent(str(rewritten(hopper_zip, tmp_path / "HopperBulletEnv-v0.zip", policy_pth=inner.getvalue())))
    assert not made.exists()


def test_yaml_that_would_run_code(hopper, tmp_path):
    made = tmp_path / "made"
    (hopper / "HopperBulletEnv-v0" / "config.yml").write_text(f"!!python/object/apply:os.mkdir ['{made}']")
    with pytest.raises(UsageError):
        import_agent(str(hopper))
    assert not made.exists()


def with_weights(hopper_zip, target, change):
    torch = pytest.importorskip("torch")
    with zipfile.ZipFile(hopper_zip) as archive:
        state = torch.load(io.BytesIO(archive.read("policy.pth")), weights_only=True)
    change(torch, state)
    buffer = io.BytesIO()
    torch.save(state, buffer)
    return rewritten(hopper_zip, target, policy_pth=buffer.getvalue())


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t, s: s["action_net.weight"].fill_(float("nan")), "not finite"),
        (lambda t, s: s.pop("action_net.bias"), "action_net.bias"),
        (lambda t, s: s.update({"action_net.weight": t.zeros(3, 5)}), "do not fit"),
        (lambda t, s: s.update({"action_net.weight": t.zeros(3, 64, 2)}), "no linear layer"),
        (
            lambda t, s: s.update(
                {"action_net.weight": t.zeros(1).expand(60000, 60000), "action_net.bias": t.zeros(60000)}
            ),
            "elements",
        ),
        (lambda t, s: s.update({"features_extractor.cnn.0.weight": t.zeros(2, 2)}), "a CNN"),
        (lambda t, s: s.update({"lstm_actor.weight_ih_l0": t.zeros(2, 2)}), "recurrent"),
        (lambda t, s: [s.pop(k) for k in list(s)], "action_net"),
        (lambda t, s: s.update({"action_net.weight": "text"}), "plain tensor"),
    ],
)
def test_weights_that_cannot_be_used(hopper_zip, tmp_path, change, word):
    path = with_weights(hopper_zip, tmp_path / "HopperBulletEnv-v0.zip", change)
    with pytest.raises(UsageError, match=word):
        import_agent(str(path), Hints(algorithm="a2c", time_feature=True))


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("sb3_contrib.common.wrappers.TimeFeatureWrapper", "utils.wrappers.HistoryWrapper", "HistoryWrapper"),
        ("- - ent_coef", "- - frame_stack\n    - 4\n  - - ent_coef", "stacks 4 frames"),
        ("env_wrapper", "other_key", "--time-feature"),
        ("- - ent_coef", "- - vec_env_wrapper\n    - some.VecWrapper\n  - - ent_coef", "VecWrapper"),
        ("- - -", "- [", "YAML"),
    ],
)
def test_configurations_that_are_not_reproduced(hopper, old, new, word):
    config = hopper / "HopperBulletEnv-v0" / "config.yml"
    config.write_text(config.read_text().replace(old, new))
    with pytest.raises(UsageError, match=word):
        import_agent(str(hopper))


def test_a_missing_normaliser_the_config_asks_for(hopper, tmp_path):
    (hopper / "HopperBulletEnv-v0" / "vecnormalize.pkl").rename(tmp_path / "elsewhere.pkl")
    output = tmp_path / "o.safetensors"
    refused(drs("import", hopper, "-o", output), "vecnormalize.pkl", "--vecnormalize")
    given = drs("import", hopper, "-o", output, "--vecnormalize", tmp_path / "elsewhere.pkl")
    assert given.returncode == 0, given.stderr


def test_the_wrong_environment_algorithm_and_action_space(hopper, hopper_zip, tmp_path):
    output = tmp_path / "o.safetensors"
    refused(drs("import", hopper, "--env", "AntBulletEnv-v0", "-o", output), "AntBulletEnv-v0")
    refused(drs("import", hopper, "--env", "NoSuch-v0", "-o", output), "NoSuch-v0")
    refused(drs("import", hopper, "--algo", "dqn", "-o", output), "'dqn'", "tqc")
    refused(drs("import", hopper, "--algo", "sac", "-o", output), "actor.mu")
    data = data_of(hopper_zip)
    data["action_space"][":type:"] = "<class 'gym.spaces.discrete.Discrete'>"
    path = rewritten(hopper_zip, tmp_path / "HopperBulletEnv-v0.zip", data=json.dumps(data))
    refused(drs("import", path, "-o", output), "Discrete", "continuous")
    assert not output.exists()


def test_a_policy_class_of_ones_own_and_a_huge_member(hopper_zip, tmp_path):
    path = tmp_path / "HopperBulletEnv-v0.zip"
    data = data_of(hopper_zip)
    data["policy_class"]["__module__"] = "__main__"
    with pytest.raises(UsageError, match="__main__"):
        import_agent(str(rewritten(hopper_zip, path, data=json.dumps(data))))
    data = data_of(hopper_zip) | {"max_grad_norm": float("inf")}
    assert import_agent(str(rewritten(hopper_zip, path, data=json.dumps(data))), Hints(time_feature=True))
    with pytest.raises(UsageError, match="16777216 bytes"):
        import_agent(str(rewritten(hopper_zip, path, data=b'{"a": ' + b"[" * 17_000_000)))


def test_a_name_that_is_no_name_and_keys_that_are_no_text():
    shared_tuple = b")" + b"2\x86" * 60
    for content in (b"\x80\x02" + shared_tuple + b")R}b.", b"\x80\x02cnumpy\nx\n)R}b."):
        with pytest.raises(UsageError, match="no VecNormalize"):
            read_normaliser(content, "x")


def test_an_activation_that_is_not_known(hopper_zip, tmp_path):
    data = data_of(hopper_zip)
    data["policy_kwargs"]["activation_fn"] = "<class 'torch.nn.modules.activation.GELU'>"
    path = rewritten(hopper_zip, tmp_path / "HopperBulletEnv-v0.zip", data=json.dumps(data))
    with pytest.raises(UsageError, match="GELU"):
        import_agent(str(path), Hints(time_feature=True))


def test_a_bare_zip_needs_what_its_folder_would_say(hopper_zip, tmp_path):
    bare = tmp_path / "bare" / "policy.zip"
    bare.parent.mkdir()
    shutil.copy(hopper_zip, bare)
    output = tmp_path / "o.safetensors"
    refused(drs("import", bare, "-o", output), "--env")
    refused(drs("import", bare, "--env", "HopperBulletEnv-v0", "-o", output), "--time-feature")
    # evaluate has no such option
    refused(drs("evaluate", bare), "--env", f"drs import {bare} -o")
    blind = drs("import", bare, "--env", "HopperBulletEnv-v0", "--time-feature", "-o", tmp_path / "blind.safetensors")
    assert "are not normalised, with a time feature" in " ".join(blind.stdout.split()), blind
    shutil.copy(hopper_zip.with_suffix("") / "vecnormalize.pkl", bare.parent)
    done = drs("import", bare, "--env", "HopperBulletEnv-v0", "--time-feature", "-o", output)
    assert "are normalised by its vecnormalize.pkl" in " ".join(done.stdout.split()), done
    from drs_core.agent import load

    whole = import_agent(str(hopper_zip.parent))
    assert load(output).digest() == whole.digest()
    assert load(output).source["algorithm"] == "a2c"
