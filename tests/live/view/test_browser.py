"""The page in a real browser: by day and night, on a screen and a telephone, with and without
scripts, and while the server dies and comes back."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.page import Page, serve

from tests.live.view.browser import CHROMIUM, Browser, browser
from tests.live.view.nows import TEXTS, before, failing, healthy, hostile

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")

SIZES = [(width, scheme) for width in (1280, 390) for scheme in ("light", "dark")]

CONTRAST = """(() => {
  const channels = (text) => text.match(/[\\d.]+/g).map(Number)
    .map((c, i) => text.startsWith('color(') && i < 3 ? 255 * c : c);
  const light = (rgb) => rgb.slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (part) => {
    const over = [];
    for (let p = part; p; p = p.parentElement) {
      const found = channels(getComputedStyle(p).backgroundColor);
      over.push(found);
      if (found.length < 4) break;
    }
    return over.reduceRight(
      (below, [r, g, b, a = 1]) => [r, g, b].map((c, i) => a * c + (1 - a) * below[i]),
      [255, 255, 255]);
  };
  const weak = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const part = walk.currentNode.parentElement;
    if (!walk.currentNode.data.trim() || !part.checkVisibility()) continue;
    const [a, b] = [light(channels(getComputedStyle(part).color)), light(behind(part))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) weak.push([ratio, walk.currentNode.data]);
  }
  return weak;
})()"""
"""Texts whose contrast is below AA of WCAG 2.2: 4.5 to 1."""

OVERFLOW = "Math.max(document.documentElement.scrollWidth, innerWidth) > screen.width"
"""A telephone makes its window wider where something does not fit: its screen stays as it is."""

OPEN = "for (const part of document.querySelectorAll('details')) part.open = true"


@dataclass
class Plant:
    """A moment that tests change, and what was acknowledged."""

    now: Now
    page: Page | None = None

    def serve(self, port: int = 0) -> str:
        self.page = serve(lambda: self.now, "127.0.0.1", port, None, self.note)
        return self.page.url

    def note(self, episode: str, _: str) -> None:
        self.now = replace(self.now, acknowledged=self.now.acknowledged | {episode})

    def close(self) -> None:
        if self.page is not None:
            self.page.close()
        self.page = None


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture
def plant(chromium: Browser) -> Iterator[Plant]:
    chromium.events.clear()
    found = Plant(failing())
    yield found
    chromium.call("Page.navigate", url="about:blank")
    found.close()


def acknowledge(chromium: Browser) -> None:
    """Press the first button."""
    chromium.run("document.querySelector('.finding button').click()")
    chromium.wait("document.querySelector('.finding')?.innerText.includes('✓ acknowledged')")


def test_nothing_overflows_and_all_text_can_be_read(chromium: Browser, plant: Plant) -> None:
    url = plant.serve()
    for name, now in (("failing", failing()), ("healthy", healthy()), ("before", before())):
        plant.now = now
        for width, scheme in SIZES:
            chromium.look(width, scheme)
            chromium.open(url)
            chromium.run(OPEN)
            assert not chromium.run(OVERFLOW), (name, width)
            assert [] == chromium.run(CONTRAST), (name, scheme)
    assert [] == chromium.complaints()
    assert {url, f"{url}now"} == chromium.asked_for()


def test_page_follows_the_plant_and_keeps_what_is_open(chromium: Browser, plant: Plant) -> None:
    url = plant.serve()
    chromium.look(1280)
    chromium.open(url)
    chromium.run(OPEN)
    chromium.run("document.querySelector('summary').setAttribute('data-old', '')")
    first, *others = plant.now.active
    plant.now = replace(
        plant.now, active=(replace(first, text="something new"), *others), connected=False
    )
    chromium.wait("document.querySelector('h3').innerText.includes('something new')")
    chromium.wait("document.querySelector('#link').innerText.includes('NOT CONNECTED')")
    assert chromium.run("document.title.includes('Something new')")
    assert not chromium.run("document.querySelector('summary').hasAttribute('data-old')")
    assert chromium.run("document.querySelector('details').open")


def test_lost_connection_is_told_and_made_anew(chromium: Browser, plant: Plant) -> None:
    url = plant.serve()
    chromium.open(url)
    chromium.wait("document.getElementById('lost').hidden")
    plant.close()
    chromium.wait("document.getElementById('lost').innerText.includes('Connection lost')")
    assert chromium.run("document.getElementById('lost').checkVisibility()")
    assert [] == chromium.run(CONTRAST)
    plant.now = replace(plant.now, title=plant.now.title, active=plant.now.active[1:])
    plant.serve(int(url.rsplit(":", 1)[1].strip("/")))
    chromium.wait("document.getElementById('lost').hidden")
    chromium.wait("document.querySelector('h3').innerText.includes('pump delivers')")
    # The forms are those of the new server.
    acknowledge(chromium)
    assert plant.now.active[0].id in plant.now.acknowledged


def test_without_scripts_forms_work(chromium: Browser, plant: Plant) -> None:
    url = plant.serve()
    chromium.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        chromium.look(390)
        chromium.open(url)
        chromium.wait("document.body.innerText.includes('even its noise is gone')")
        assert f"{url}now" not in chromium.asked_for()
        acknowledge(chromium)
        assert url == chromium.run("location.href")
    finally:
        chromium.call("Emulation.setScriptExecutionDisabled", value=False)


def test_hostile_texts_run_nothing(chromium: Browser, plant: Plant) -> None:
    """All at once, as the plant sends them while the page is open."""
    url = plant.serve()
    chromium.look(390)
    chromium.open(url)
    chromium.run(OPEN)
    elements = "document.querySelectorAll('script, img, iframe, b#pwned, [onerror]').length"
    for i, text in enumerate(["".join(TEXTS[:-1]), TEXTS[-1]]):
        now = hostile(text)
        plant.now = replace(now, plant=f"{i}" + now.plant)
        chromium.wait(f"document.title.includes(' {i}')")
        chromium.run(OPEN)
        assert 1 == chromium.run(elements)
        assert not chromium.run(OVERFLOW)
        chromium.open(url)
        assert 1 == chromium.run(elements)
        assert "undefined" == chromium.run("typeof window.pwned")
        assert not chromium.run(OVERFLOW)
    assert [] == chromium.complaints()
    assert {url, f"{url}now"} == chromium.asked_for()
