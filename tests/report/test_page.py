"""The page as a browser sees it."""

import re

import pytest

from drs_core.agent import load
from tests.conftest import drs, make_agent

LOOKS = {
    "light": {"viewport": {"width": 1280, "height": 900}, "color_scheme": "light"},
    "dark": {"viewport": {"width": 1280, "height": 900}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 360, "height": 740}, "color_scheme": "light"},
}
DECODED = "Promise.all([...document.images].map(image => image.decode())).then(() => document.images.length)"
UNREADABLE = """[...document.querySelectorAll('h1, h2, p, th, td, figcaption, svg text')]
    .filter(e => e.checkVisibility()).filter(e => getComputedStyle(e).fontSize.replace('px', '') < 8).length"""
PLAYED = """async () => {
    const video = document.querySelector('video')
    await video.play()
    await new Promise(done => video.addEventListener('timeupdate', () => video.currentTime > 0.1 && done()))
    return [video.readyState >= 2, video.videoWidth, video.muted, video.loop]
}"""


def opened(chromium, path, **look):
    """A page, with all that it said and asked for."""
    page = chromium.new_page(**look)
    said, asked = [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("dialog", lambda dialog: (said.append(dialog.message), dialog.dismiss()))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.resolve().as_uri())
    return page, said, asked


def checked(page, said, asked):
    """What holds for every page in every look."""
    assert said == []
    assert [url for url in asked if not url.startswith("data:")] == asked[:1]
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.evaluate(UNREADABLE) == 0
    assert page.evaluate("document.documentElement.lang") == "en"
    assert page.evaluate("document.querySelectorAll('script').length") == 0
    ids = page.evaluate("[...document.querySelectorAll('[id]')].map(e => e.id)")
    assert len(ids) == len(set(ids)) > 10
    # what a figure draws with is in the page, under the name that it is asked for
    named = re.findall(r'(?:url\(|href=")#([^")]+)', page.content())
    assert set(named) <= set(ids)


@pytest.mark.parametrize("look", LOOKS)
def test_the_page_is_whole_in_every_look(chromium, panda_report, look):
    page, said, asked = opened(chromium, panda_report[0], **LOOKS[look])
    checked(page, said, asked)
    assert page.evaluate(DECODED) >= 1
    headings = page.locator("h1, h2").all_inner_texts()
    for heading in ("The tip over time", "Path and jitter", "All measures", "What was tuned, and how", "Repeat it"):
        assert heading in headings
    assert page.locator("figure svg[role=img][aria-label]").count() == page.locator("figure svg").count() >= 10
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (max(map(int, re.findall(r"\d+", background)[:3])) < 64) == (look == "dark")
    page.close()


def test_the_film_plays(chromium, panda_report):
    page, said, _ = opened(chromium, panda_report[0])
    ready, width, muted, loop = page.evaluate(PLAYED)
    assert ready and muted and loop and width == 968 and said == []
    page.close()


def test_print_shows_a_still_instead_of_the_film(chromium, panda_report):
    page, _, _ = opened(chromium, panda_report[0])
    assert page.locator("video").is_visible() and not page.locator(".still").is_visible()
    page.emulate_media(media="print", color_scheme="dark")
    assert page.locator(".still").is_visible() and not page.locator("video").is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.pdf(format="A4")[:5] == b"%PDF-"
    page.close()


def test_names_in_files_are_text_and_nothing_else(chromium, tmp_path):
    """A run of another kind, whose every name is an attack; of no update as well as of one."""
    attack = "<script>alert(1)<script><img src=x onerror=alert(2)>"
    agent = make_agent()
    agent.source[attack] = f'"></td>{attack}{{{{ 7 * 7 }}}}'
    agent_file, run = tmp_path / f"{attack}.safetensors", tmp_path / "run"
    agent.save(agent_file)
    quick = ("--directions", 1, "--updates", 2, "--workers", 0, "--evaluate-every", 0)
    result = drs("tune", agent_file, "--output", run, *quick, "--stop-after", 1)
    assert result.returncode == 0, result.stderr
    for done in (1, 0):
        if not done:
            (run / "agent.safetensors").unlink()
        result = drs("report", run, "--episodes", 10, "--workers", 0, *([] if done else ["--no-video"]))
        assert result.returncode == 0, result.stderr
        page, said, asked = opened(chromium, run / "report.html", **LOOKS["phone"])
        checked(page, said, asked)
        text = page.locator("body").inner_text()
        assert attack in text and "{{ 7 * 7 }}" in text and page.locator("img:not(.still)").count() == 0
        assert ("after 1 of 2 updates" in text) if done else ("Not tuned yet" in text)
        assert page.locator("video").count() == done
        page.close()
    assert load(agent_file).source == agent.source
