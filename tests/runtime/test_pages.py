"""All pages in a real browser: on a telephone, a screen and paper, by day and night."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.live.view.browser import CHROMIUM, Browser, browser
from tests.live.view.test_browser import CONTRAST
from tests.runtime.pages import every_page

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")

CUT = """(() => {
  const cut = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const part = walk.currentNode.parentElement;
    if (!walk.currentNode.data.trim() || !part.checkVisibility()) continue;
    if (part.closest('.scroll, title, thead, .symbols')) continue;
    const range = document.createRange();
    range.selectNodeContents(walk.currentNode);
    const box = range.getBoundingClientRect();
    if (box.width && (box.left < 0 || box.right > innerWidth)) cut.push(walk.currentNode.data);
  }
  return cut;
})()"""
"""Texts that stick out of the window, and are in no frame that scrolls."""

WIDE = """[...document.querySelectorAll('.fold')].filter(
  (table) => table.scrollWidth > table.parentElement.clientWidth + 1).length"""
"""Tables that should have become cards, and did not."""

OVER_THE_EDGE = """[...document.querySelectorAll('.scroll')].filter(
  (frame) => frame.scrollWidth > frame.clientWidth + 1
    || frame.getBoundingClientRect().right > innerWidth).length"""
"""Frames that scroll on a screen, and would have to on paper."""

UNSPOKEN = """[...document.querySelectorAll('svg:not([aria-hidden])')].filter(
  (svg) => !svg.closest('[role=img]')?.getAttribute('aria-label')).length"""
"""Pictures without words for those who cannot see them."""

HEADINGS = "[...document.querySelectorAll('h1')].map((heading) => heading.textContent)"


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


SHUT = """(() => [...document.querySelectorAll('details > :not(summary)')].filter(
  (part) => !part.checkVisibility({contentVisibilityAuto: true})
    || part.getBoundingClientRect().height === 0).length)()"""
"""What nobody can open on paper."""

PAPER = 680
"""Pixels across the text of a sheet of A4, upright."""


def test_every_page_fits_telephone_screen_and_paper_and_says_its_verdict_first(
    chromium: Browser, tmp_path: Path
) -> None:
    pages = every_page()
    wrong: list[tuple[str, str, object]] = []
    for name, (page, verdict) in pages.items():
        file = tmp_path / f"{name.replace(' ', '-')}.html"
        file.write_text(page, encoding="utf-8")
        chromium.look(390)
        chromium.open(file.as_uri())
        found: dict[str, object] = {}
        for width, scheme in ((w, s) for w in (390, 1280) for s in ("light", "dark")):
            chromium.look(width, scheme)
            found[f"weak at {width}, {scheme}"] = chromium.run(CONTRAST)
            if scheme == "light":
                found |= _misfits(chromium, width)
        chromium.look(PAPER, "dark")
        chromium.print(True)
        found |= _misfits(chromium, PAPER)
        found["shut on paper"] = chromium.run(SHUT)
        found["cut on paper"] = chromium.run(OVER_THE_EDGE)
        found["weak on paper"] = chromium.run(CONTRAST)
        chromium.print(False)
        if [verdict] != chromium.run(HEADINGS):
            wrong.append((name, "heading", verdict))
        wrong += [(name, what, value) for what, value in found.items() if value]
    assert [] == wrong
    assert [] == chromium.complaints()
    assert {f"{n.replace(' ', '-')}.html" for n in pages} == {
        url.rsplit("/")[-1] for url in chromium.asked_for()
    }


def _misfits(chromium: Browser, width: int) -> dict[str, object]:
    """What does not fit a window or a sheet so wide; wide tables may scroll but on a telephone."""
    return {
        f"sideways at {width}": chromium.run(f"document.documentElement.scrollWidth > {width}"),
        f"cut at {width}": chromium.run(CUT),
        f"no cards at {width}": width == 390 and chromium.run(WIDE),
        f"unspoken at {width}": chromium.run(UNSPOKEN),
    }
