"""The documentation is true: links, commands and examples."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import drs

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("drs_core/**/*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        assert link.startswith("http") or (page.parent / link).exists(), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_a_page_names_exist(page):
    names = re.findall(r"`((?:drs_core|tests|params|examples)/[\w/.-]+\.\w+)`", page.read_text())
    assert all((ROOT / name).exists() for name in names), names


def test_commands_of_the_readme_exist_with_their_options():
    lines = re.findall(r"`drs (\w+)([^`]*)`", (ROOT / "README.md").read_text())
    assert len(lines) >= 6
    helps = {command: drs(command, "--help", COLUMNS="200").stdout for command, _ in set(lines)}
    for command, rest in lines:
        for option in re.findall(r"(?<!\S)--?[a-z][a-z-]*", rest):
            assert option in helps[command], (command, option)


def test_files_are_small_and_the_library_knows_no_ros():
    for path in ROOT.glob("drs_core/**/*.py"):
        text = path.read_text()
        assert text.count("\n") < 400, path
        assert "rclpy" not in text, path
        assert not re.search(r"\b(pickle|cloudpickle|marshal|shelve)\.loads?\b|\beval\(|\bexec\(|UnsafeLoader", text), (
            path
        )


@pytest.mark.parametrize("example", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.name)
def test_examples_run_and_are_short(example, tmp_path):
    assert example.read_text().count("\n") < 40
    result = subprocess.run(
        [sys.executable, str(example), "1"], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert result.returncode == 0, result.stderr
    says = {"tune_in_python.py": "P(after better)", "last_layer.py": "run,seed,updates,return_mean,reached\nPanda"}
    assert says[example.name] in result.stdout
