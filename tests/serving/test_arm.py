"""Files of arms: what they hold, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from drs_core.errors import UsageError
from drs_core.serving import arm as arms
from drs_core.serving.arm import ARM_IDS, read_arm

FOLDER = Path(arms.__file__).with_name("arms")


@pytest.mark.parametrize("arm_id", ARM_IDS)
def test_every_arm_has_its_names_and_a_neutral_posture_within_its_limits(arm_id):
    arm = read_arm(arm_id)
    assert arm.joints == tuple(f"{arm_id}_joint{i}" for i in range(1, 8)) and arm.base_frame == f"{arm_id}_link0"
    assert (arm.limits.position_min_rad < arm.neutral_rad).all() and (
        arm.neutral_rad < arm.limits.position_max_rad
    ).all()


def test_fer_is_the_panda_by_another_name():
    for name, values in vars(read_arm("panda").limits).items():
        assert np.array_equal(values, getattr(read_arm("fer").limits, name))


def test_the_rectangle_of_fr3_lies_where_every_velocity_is_allowed():
    # libfranka, rate_limiting.h: v(q) = -offset + sqrt(factor * (end - q)), at most v_max
    limits = read_arm("fr3").limits
    ends = np.array([2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196])
    starts = np.array([-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196])
    offset = np.array([0.3, 0.2, 0.2, 0.3, 0.35, 0.35, 0.35])
    factor = np.array([12.0, 5.17, 7.0, 8.0, 34.0, 11.0, 34.0])
    v_max = np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26])
    for room in (ends - limits.position_max_rad, limits.position_min_rad - starts):
        allowed = np.minimum(v_max, -offset + np.sqrt(factor * room))
        assert (limits.velocity_max_rad_s <= allowed + 1e-3).all()


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("jerk_max_rad_s3: [7500.0,", "jerk_max_rad_s3: [-7500.0,", "jerk_max_rad_s3"),
        ("velocity_max_rad_s: [2.175, ", "velocity_max_rad_s: [", "7 finite numbers"),
        ("velocity_max_rad_s: [2.175,", "velocity_max_rad_s: [.nan,", "list of 7 numbers"),
        ("velocity_max_rad_s: [2.175,", "velocity_max_rad_s: [fast,", "list of 7 numbers"),
        ("position_min_rad: [-2.8973,", "position_min_rad: [3.0,", "must lie below"),
        ("flange_m: 0.107", "flange_m: true", "flange_m"),
        ("arm_ids: [panda, fer]", "arm_ids: [fr3]", "fr3"),
        ("dh_a_m:", "dh_b_m:", "dh_a_m"),
    ],
)
def test_a_wrong_file_is_refused_with_the_name_and_value(tmp_path, before, after, words):
    text = (FOLDER / "panda.yaml").read_text()
    assert before in text
    path = tmp_path / "arm.yaml"
    path.write_text(text.replace(before, after))
    with pytest.raises(UsageError, match=words):
        read_arm("panda", path)


def test_an_unknown_arm_is_refused():
    with pytest.raises(UsageError, match="panda, fer, fr3"):
        read_arm("ur5")
