"""What pages print is what the ledger says, and what it says was measured."""

from __future__ import annotations

import dataclasses
import functools
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import ROOT, SOURCES, recordings_folder
from tests.figures.change import write_figures, write_places
from tests.figures.commands import Measured, output_here, picked, quick_verdict, updated
from tests.figures.content import content_of, is_stale
from tests.figures.ledger import FILE, Figure, Ledger, mistakes, read_ledger
from tests.figures.pages import misprints, unclaimed
from tests.figures.plain_code import plain_code
from tests.figures.share import Share
from tests.figures.sources import HOOK, environment, files_of, read_sources, used, write_sources


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


def isolation(ledger: Ledger) -> Figure:
    """The figure that stood there when it was no longer true."""
    return ledger.figures["isolation.sound-start.0.1"]


def test_pages_print_what_the_ledger_says(ledger: Ledger) -> None:
    """README and docs; also nothing that the ledger refers to is gone from them."""
    assert [] == misprints(ledger)


def test_somebody_answers_for_every_number(ledger: Ledger) -> None:
    """A number on a page is a figure, part of an account, or listed as no claim."""
    assert [] == [str(number) for number in unclaimed(ledger)]


def test_stale_figures_are_told(ledger: Ledger) -> None:
    """No failure, as every commit would be one: a warning with their number."""
    stale = [f.id for f in ledger.figures.values() if is_stale(f, ledger)]
    if stale:
        warnings.warn(
            f"{len(stale)} of {len(ledger.figures)} printed figures are older than the code: "
            "python -m tests.figures list",
            stacklevel=1,
        )
    assert all(ledger.figures[name].kind == "measured" for name in stale)


def test_a_wrong_figure_on_a_page_is_told(ledger: Ledger, copy: Path) -> None:
    """Somebody writes another number than was measured."""
    page = copy / "docs" / "proof.md"
    text = page.read_text(encoding="utf-8")
    was = f"{100 * isolation(ledger).value:.0f}"
    row = next(line for line in text.splitlines() if "right fault named at degree" in line)
    page.write_text(text.replace(row, row.replace(was, "71", 1)), encoding="utf-8")
    told = misprints(ledger, copy)
    assert [f"docs/proof.md: isolation.sound-start.0.1:.0%: prints 71, measured {was}"] == told


def test_a_new_number_is_told(ledger: Ledger, copy: Path) -> None:
    """A claim without a figure, in prose and in a table; what is code is no claim."""
    with (copy / "README.md").open("a", encoding="utf-8") as file:
        file.write("\nIt finds 97 % of `all 12` leaks.\n\n| speed | 812 |\n")
    told = list(unclaimed(ledger, copy))
    assert ["97", "812"] == [number.number for number in told]
    assert {"README.md"} == {number.file for number in told}


def test_a_new_measurement_is_written_everywhere(ledger: Ledger, copy: Path) -> None:
    """Into the ledger and into the page; all other lines stay."""
    file = copy / "docs" / "figures.yaml"
    found = updated(isolation(ledger), Measured(0.5, 90, 180), "abc1234", "2030-01-01", "f00")
    write_figures([found], file)
    again = read_ledger(file)
    fields = ("value", "count", "of", "commit", "date", "content")
    written = tuple(getattr(again.figures[found.id], name) for name in fields)
    assert (0.5, 90, 180, "abc1234", "2030-01-01", "f00") == written
    others = [f for name, f in again.figures.items() if name != found.id]
    assert others == [f for name, f in ledger.figures.items() if name != found.id]
    assert ["docs/proof.md"] == write_places(again, [found.id], copy)
    assert [] == misprints(again, copy)
    changed = (copy / "docs" / "proof.md").read_text(encoding="utf-8").splitlines()
    before = (ROOT / "docs" / "proof.md").read_text(encoding="utf-8").splitlines()
    assert 1 == sum(a != b for a, b in zip(changed, before, strict=True))


def test_figures_grow_stale_with_their_files(ledger: Ledger, tmp_path: Path) -> None:
    """A changed byte below `runtime` and one more file count; a file elsewhere does not. So it is
    where nothing was noted."""
    for folder in ("one", "two", "three", "four"):
        place = tmp_path / folder / "runtime" / "rulec_runtime" / "contract"
        place.mkdir(parents=True)
        (place / "plan.py").write_text("1 + 1\n", encoding="utf-8")
    (tmp_path / "two" / "runtime" / "rulec_runtime" / "contract" / "plan.py").write_text(
        "1 + 2\n", encoding="utf-8"
    )
    (tmp_path / "three" / "runtime" / "rulec_runtime" / "contract" / "more.py").touch()
    (tmp_path / "four" / "tests").mkdir()
    (tmp_path / "four" / "tests" / "test_it.py").touch()
    figure = dataclasses.replace(isolation(ledger), command="never run since files are noted")
    one, two, three, four = (
        content_of(figure, ledger, tmp_path / name) for name in ("one", "two", "three", "four")
    )
    assert one == four
    assert 3 == len({one, two, three})


def test_what_contradicts_itself_is_told(ledger: Ledger) -> None:
    """A value outside of its interval, an unknown set of files, a count of another value."""
    wrong = dataclasses.replace(isolation(ledger), low=0.999, high=1.0, depends=("nothing",))
    other = dataclasses.replace(isolation(ledger), id="other", count=1)
    told = mistakes(dataclasses.replace(ledger, figures={"wrong": wrong, "other": other}))
    for word in ("lies outside of 0.999 to 1.0", "no set of files 'nothing'", "1 of 180 is not"):
        assert 1 == sum(word in line for line in told), word


def test_a_small_count_contradicts_what_is_printed() -> None:
    """The regression: printed 0.98, and 62 of 72 today; 70 of 72 would agree."""
    figure = dataclasses.replace(
        isolation(read_ledger(FILE)), value=0.98, low=0.944, high=0.996, count=176, of=180
    )
    assert "printed 0.98; today 62 of 72" in quick_verdict(figure, Measured(62 / 72, 62, 72))
    assert "" == quick_verdict(figure, Measured(70 / 72, 70, 72))


def test_another_value_is_held_against_its_tolerance() -> None:
    """Without a count the interval of the ledger decides."""
    figure = dataclasses.replace(
        isolation(read_ledger(FILE)), value=1.0, low=0.9, high=1.1, count=None, of=None
    )
    assert "" == quick_verdict(figure, Measured(1.05))
    assert "today 1.2" in quick_verdict(figure, Measured(1.2))


def test_values_are_picked_from_json() -> None:
    """By names and by places in a list; a share with its count."""
    share = {"value": 0.5, "count": 1, "of": 2}
    form = {"a": {"0.1": share, "days": [3, 4]}}
    assert Measured(0.5, 1, 2) == picked(form, "a/0.1")
    assert Measured(4.0) == picked(form, "a/days/1")


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(0, 100_000, 0.0, 3.6888e-5), (8, 10, 0.44390, 0.97479), (10, 10, 0.69150, 1.0)],
)
def test_the_interval_of_a_share(count: int, of: int, low: float, high: float) -> None:
    """Clopper and Pearson. Source of 8 of 10: R, binom.test(8, 10); the others by hand,
    1 - 0.025^(1/n) and 0.025^(1/n)."""
    assert (low, high) == pytest.approx(Share(count, of).interval, rel=1e-4)


def test_figures_depend_on_what_their_command_used(tmp_path: Path) -> None:
    """Also what a process below it used, though it was killed; not what was only looked for."""
    note, place = tmp_path / "used", ROOT / "kb" / "fluids"
    note.touch()
    script = (
        "import importlib, os, signal\n"
        "from pathlib import Path\n"
        "importlib.import_module('tests.figures.share')\n"
        f"Path({str(place / 'water.yaml')!r}).read_text()\n"
        "if os.fork() == 0:\n"
        "    import rulec.limits\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "os.wait()\n"
    )
    path = os.pathsep.join([str(HOOK), SOURCES])
    environ = {**os.environ, **environment(note), "PYTHONPATH": path}
    subprocess.run([sys.executable, "-c", script], check=True, env=environ, cwd=tmp_path)
    found = used(note)
    code = {"tests/figures/share.py", "tests/figures/__init__.py", "rulec/limits.py"}
    assert code | {"kb/fluids/*"} <= set(found)
    assert [f"kb/fluids/{name}" for name in sorted(os.listdir(place))] == files_of("kb/fluids/*")
    assert "tests/figures/ledger.py" not in found


def test_what_was_noted_is_read_back(tmp_path: Path) -> None:
    """Command by command; what was noted of others stays."""
    file = tmp_path / "sources.json"
    write_sources("one", ["a/b.py", "a/c.py"], file)
    write_sources("two", ["kb/x.yaml"], file)
    write_sources("one", ["a/c.py"], file)
    assert {"one": ("a/c.py",), "two": ("kb/x.yaml",)} == read_sources(file)


@pytest.mark.parametrize(
    ("one", "two", "same"),
    [
        ("x = 1\n", 'x = 1  # one\n\n"""Text\nof it."""\n', True),
        ('def f():\n    """Doc."""\n    return 2\n', "def f():\n\n    return 2\n", True),
        ("x = 1\n", "x = 2\n", False),
        ('x = "a # b"\n', 'x = "a # c"\n', False),
        ('x = (\n    "a"\n    "b"\n)\n', 'x = (\n    "a"\n)\n', False),
        ('x = """\na\n"""\n', 'x = """\nb\n"""\n', False),
        ("if x:\n    y\nz\n", "if x:\n    y\n    z\n", False),
    ],
)
def test_comments_and_docstrings_make_no_figure_stale(one: str, two: str, same: bool) -> None:
    """What computes does: strings in expressions, numbers, indentation."""
    assert same == (plain_code(one) == plain_code(two))


QUICK = [f for f in read_ledger().figures.values() if f.quick]


@functools.cache
def output(command: str) -> Any:
    """What a command gives; once for all its figures."""
    return output_here(command)


@pytest.mark.parametrize("figure", QUICK, ids=lambda f: f.id)
def test_what_is_printed_is_still_true(figure: Figure) -> None:
    """If this fails: mend what changed the figure, or `make figures ONLY=...` and say why."""
    assert figure.quick is not None
    if figure.needs and not (recordings_folder() / figure.needs).exists():
        pytest.skip(f"no recording {figure.needs}")
    found = picked(output(figure.quick.command), figure.quick.key)
    assert "" == quick_verdict(figure, found)


def test_isolation_is_among_them() -> None:
    """It once went from 0.98 to 0.86 and nobody saw it."""
    assert {f"isolation.sound-start.0.{k}" for k in (1, 2, 3)} <= {f.id for f in QUICK}
