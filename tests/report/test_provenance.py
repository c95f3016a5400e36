from types import SimpleNamespace

from drs_core.agents import shipped
from drs_core.importing import resolve
from drs_core.report.provenance import origin


def test_what_a_file_nests_too_deep_is_left_out():
    source: dict[str, object] = {"seed": 1}
    for _ in range(2000):
        source = {"more": source}
    findings = SimpleNamespace(
        before=SimpleNamespace(agent=SimpleNamespace(source=source)), run=SimpleNamespace(name="x")
    )
    rows = dict(origin(findings))
    assert rows["more"].endswith("\N{HORIZONTAL ELLIPSIS}))))")


def test_where_an_agent_comes_from_is_told_in_words():
    for name in shipped():
        findings = SimpleNamespace(before=SimpleNamespace(agent=resolve(name)), run=SimpleNamespace(name=name))
        rows = dict(origin(findings))
        assert rows["trained by"] == "drs train" and not set("{}[]'\"") & set("".join(rows.values()))
        assert rows["evaluation"].startswith("episodes ") and "hidden " in rows["settings"]
    assert "hidden 256\N{MULTIPLICATION SIGN}256, hindsight yes, imitate 200000" in rows["settings"]
