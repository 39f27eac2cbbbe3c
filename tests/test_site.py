"""The pages as a site: built strictly, and nothing of it comes from elsewhere."""

import re
from pathlib import Path

import pytest

from tests.conftest import ROOT

SITE = ROOT / "docs" / "site"
FETCHED = re.compile(r"""<(?:script|link|img|iframe)\b[^>]*?(?:src|href)="(https?:)?//[^"]*\"""")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built without a network; a warning of any kind is a mistake."""
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NO_MKDOCS_2_WARNING", "1")
        patch.setenv("COLUMNS", "100")
        folder = tmp_path_factory.mktemp("site")
        build(load_config(str(SITE / "mkdocs.yml"), site_dir=str(folder), strict=True))
    return folder


def test_every_page_is_in_the_navigation_and_fetches_nothing(built: Path) -> None:
    """Also pages that are made: front page, changes, reference. No fonts, scripts, pictures of
    other servers: a control room has no internet."""
    pages = {page.stem for page in (ROOT / "docs").glob("*.md")} | {"index", "changelog"}
    pages |= {f"reference/{name}" for name in ("commands", "yaml", "library", "json", "python")}
    front = (built / "index.html").read_text(encoding="utf-8")
    navigation = set(re.findall(r'<a href="([\w./-]+)\.html" class="md-nav__link', front))
    assert pages - {"index"} <= navigation
    assert all((built / f"{page}.html").exists() for page in pages)
    for page in built.rglob("*.html"):
        assert not FETCHED.findall(page.read_text(encoding="utf-8")), page.name
    for sheet in built.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(https?:)?//", sheet.read_text(encoding="utf-8"))


def test_the_reference_is_made(built: Path) -> None:
    """Of commands, files, the library with its curves, JSON forms and functions."""
    for page, *expected in (
        ("commands", "rulec import mtp", "rulec-runtime watch", "--heldout FROM:TO"),
        ("yaml", "signals", "Standard uncertainty", "offset"),
        ("library", "gear-pump", "clearance-wear(Q_slip)", "Wilson 1946"),
        ("json", "findings[].degree", "ambiguities[].advice", "modules.NAME"),
        ("python", "rulec.diagnose", "rulec.MismatchResult", "RecordingRefused"),
    ):
        text = re.sub(r"<[^>]+>", "", (built / f"reference/{page}.html").read_text("utf-8"))
        assert [] == [word for word in expected if word not in text]
    library = (built / "reference" / "library.html").read_text(encoding="utf-8")
    sections = re.split(r"<h2 id=", library)[1:]
    drawn = {part.split('"')[1] for part in sections if "<polyline" in part}
    assert {"gear-pump", "centrifugal-duty", "orifice-meter", "control-valve"} <= drawn
    assert len(drawn) > 0.8 * len(sections)
