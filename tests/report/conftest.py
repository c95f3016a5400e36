"""A tiny run of the shipped arm and its report, made once; a browser where there is one."""

import json
import shutil
from pathlib import Path

import pytest

from tests.conftest import drs


@pytest.fixture(scope="session")
def panda_run(tmp_path_factory) -> Path:
    run = tmp_path_factory.mktemp("panda") / "run"
    settings = ("--updates", 2, "--directions", 2, "--objective", "smooth")
    evaluations = ("--evaluate-every", 2, "--evaluation-episodes", 2)
    result = drs("tune", "panda_reach", "--output", run, *settings, *evaluations, "--workers", 0)
    assert result.returncode == 0, result.stderr
    return run


@pytest.fixture(scope="session")
def panda_report(panda_run) -> tuple[Path, dict]:
    """The page with its film, and what ``--json`` says."""
    result = drs("report", panda_run, "--episodes", 10, "--workers", 2, "--json")
    assert result.returncode == 0, result.stderr
    return panda_run / "report.html", json.loads(result.stdout)


@pytest.fixture(scope="session")
def chromium():
    """A headless Chromium of this machine."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="the page was not opened: playwright is missing")
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        pytest.skip("the page was not opened in a browser: no chromium here (apt-get install chromium)")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()
