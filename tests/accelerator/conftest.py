"""Skips where the helper was not built."""

import pytest

from drs_core.accelerator.library import Unavailable, helper


@pytest.fixture(scope="session")
def built():
    """The helper of the package."""
    try:
        return helper()
    except Unavailable as reason:
        pytest.skip(f"the accelerator: {reason}")
