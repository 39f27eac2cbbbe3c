"""What pages print is what the ledger says, and what it says was measured."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.figures import measure
from tests.figures.ledger import (
    FILE,
    Ledger,
    Measurement,
    Share,
    misprints,
    read_ledger,
    rendered,
    unclaimed,
)
from tests.figures.measure import content_of, files_of, is_stale, measured_again, write

PLACE = "sound-start/degree/0.1/first"


@pytest.fixture(scope="module")
def ledger() -> Ledger:
    """The ledger of the project; reading it checks it."""
    return read_ledger()


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """README, pages and ledger in a folder of their own."""
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    shutil.copy(ROOT / "README.md", tmp_path)
    return tmp_path


def isolation(ledger: Ledger) -> Measurement:
    """A figure that once stood there when it was no longer true."""
    return ledger.measurements["isolation"]


def test_pages_print_what_the_ledger_says_and_no_other_number(ledger: Ledger) -> None:
    """README and docs; also nothing that the ledger refers to is gone from them."""
    assert [] == [*misprints(ledger), *unclaimed(ledger)]


def test_every_room_has_files(ledger: Ledger) -> None:
    assert all(files_of(globs) for globs in ledger.rooms.values())


def test_a_wrong_figure_on_a_page_is_told(ledger: Ledger, copy: Path) -> None:
    """Somebody writes another number than was measured; then the row goes."""
    page = copy / "docs" / "proof.md"
    text = page.read_text(encoding="utf-8")
    was = rendered(f"{PLACE}:.0%", isolation(ledger).values)
    row = next(line for line in text.splitlines() if "right fault named at degree" in line)
    page.write_text(text.replace(row, row.replace(was, "71", 1)), encoding="utf-8")
    assert [f"docs/proof.md: {PLACE}:.0%: prints 71, measured {was}"] == misprints(ledger, copy)
    page.write_text(text.replace(row, ""), encoding="utf-8")
    (misprint,) = misprints(ledger, copy)
    assert misprint.startswith("docs/proof.md: nowhere found: | right fault named")


def test_a_new_number_is_told(ledger: Ledger, copy: Path) -> None:
    """A claim without a figure, in prose and in a table; what is code is no claim."""
    with (copy / "README.md").open("a", encoding="utf-8") as file:
        file.write("\nIt finds 97 % of `all 12` leaks.\n\n| speed | 812 |\n")
    numbers = list(unclaimed(ledger, copy))
    assert [": 97 in ", ": 812 in "] == [n[n.index(": ") : n.index("'")] for n in numbers]


def test_a_new_measurement_is_written_everywhere(
    ledger: Ledger, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Into the ledger and into the page; all other lines stay, and it is stale no longer."""
    half = {"count": 90, "of": 180, "value": 0.5}
    form = {"sound-start": {"degree": {key: {"first": half} for key in ("0.1", "0.2", "0.3")}}}
    monkeypatch.setattr(measure, "output_of", {isolation(ledger).command: form}.__getitem__)
    new = measured_again(isolation(ledger), ledger)
    write(new, copy)
    again = read_ledger(copy / "docs" / "figures.yaml")
    assert {**ledger.measurements, "isolation": new} == again.measurements
    assert Share(90, 180) == new.values[PLACE]
    assert not is_stale(new, again)
    assert [] == misprints(again, copy)
    for file, lines in (("proof.md", 1), ("figures.yaml", 6)):
        pair = [(top / "docs" / file).read_text("utf-8").splitlines() for top in (ROOT, copy)]
        changed = sum(a != b for a, b in zip(*pair, strict=True))
        assert 0 < changed <= lines  # date and content may be those of the last measurement


@pytest.mark.parametrize(
    ("one", "two", "same"),
    [
        ("x = 1\n", 'x = 1  # one\n\n"""Text\nof it."""\n', True),
        ('x = """\na\n"""\n', 'x = """\nb\n"""\n', False),
        ("if x:\n    y\nz\n", "if x:\n    y\n    z\n", False),
    ],
)
def test_a_figure_grows_stale_with_its_rooms(
    one: str, two: str, same: bool, ledger: Ledger, tmp_path: Path
) -> None:
    """By what computes: by no comment or docstring, nor by a file elsewhere."""
    ours = replace(ledger, rooms={"rules": ("rulec/*.py",)})
    measurement, contents = replace(isolation(ledger), depends=("rules",)), set()
    for name, text in (("one", one), ("two", two)):
        elsewhere = tmp_path / name / "rulec" / name
        elsewhere.mkdir(parents=True)
        for file in (elsewhere / "a.py", elsewhere.parent / "a.py"):
            file.write_text(text, encoding="utf-8")
        contents.add(content_of(measurement, ours, tmp_path / name))
    assert same == (1 == len(contents))


def test_a_ledger_that_contradicts_itself_is_refused(tmp_path: Path) -> None:
    text = FILE.read_text(encoding="utf-8")
    for was, becomes, expected in (
        ("kind: quoted", "kind: heard", "paper: kind 'heard'"),
        ("[compiler]", "[nothing]", "compile: no room nothing"),
        ("id: hsy", "id: zema", "'zema' stands twice"),
        ("{settled:.0f}", "{set:.0f}", "printed without a value, or a value that no page"),
    ):
        (tmp_path / "it.yaml").write_text(text.replace(was, becomes, 1), encoding="utf-8")
        with pytest.raises(ValueError, match=expected):
            read_ledger(tmp_path / "it.yaml")
