"""Every diagnostic code has a failing example, whose whole text is compared."""

import contextlib
import os
import random
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from rulec.commands.check_files import collect
from rulec.fleet.fleet_file import read_fleet
from rulec.language.diagnostics import Refused, render_all
from rulec.limits import MAX_FILE_BYTES
from rulec.passes.pipeline import compile_plant
from rulec.separation.limits_file import read_limits
from tests.conftest import ROOT, Patch
from tests.hostile.json_cases import parts

ERRORS = Path("tests/errors")
EXAMPLES = sorted(f.name for f in (ROOT / ERRORS).iterdir() if f.is_dir())
MEANINGS = dict(
    line.split(" ", 1)
    for line in (ROOT / ERRORS / "meanings.txt").read_text(encoding="utf-8").splitlines()
)
TOO_LARGE = "KB002-too-large"


@pytest.fixture(autouse=True)
def _at_home(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths in the expected texts are relative to the project folder."""
    monkeypatch.chdir(ROOT)
    monkeypatch.delenv("RULEC_KB", raising=False)


@pytest.fixture(scope="module")
def without_effects(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project folder whose knowledge base holds no effects: four fifths of what `check` reads
    each time."""
    home = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "kb", home / "kb", ignore=shutil.ignore_patterns("effects"))
    (home / "tests").symlink_to(ROOT / "tests")
    return home


def _needs_effects(name: str) -> bool:
    """Whether an example describes an effect, or has a knowledge base of its own."""
    folder = ROOT / ERRORS / name
    described = (re.search(rb"^effect:", f.read_bytes(), re.M) for f in folder.rglob("*.yaml"))
    return (folder / "kb").exists() or any(described)


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_says_what_is_expected(
    name: str, without_effects: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One mistake gives one diagnostic, with exactly this text."""
    if not _needs_effects(name):
        monkeypatch.chdir(without_effects)
        monkeypatch.setenv("RULEC_KB", "kb")
    with _input(name):
        text = _text_of(ERRORS / name)
    expected = ERRORS / name / "expected.txt"
    if os.environ.get("RULEC_REMAKE"):
        expected.write_text(text, encoding="utf-8")
    assert expected.read_text(encoding="utf-8") == text
    assert [name[:5]] == re.findall(r"^KB\d{3}", text, re.MULTILINE)
    assert re.search(r"\n1 (mistake|warning) in 1 file\n\Z", text)


@contextlib.contextmanager
def _input(name: str) -> Iterator[None]:
    """The one example that is too large to keep is written for the moment."""
    if name != TOO_LARGE:
        yield
        return
    file = ERRORS / name / "module.yaml"
    file.write_text(
        "# a log file, named .yaml by mistake\n" * (MAX_FILE_BYTES // 30), encoding="utf-8"
    )
    yield
    file.unlink()


def _limits(file: Path) -> object:
    return read_limits(file, compile_plant(file.parent))


def _text_of(folder: Path) -> str:
    """What `rulec check` prints, or `rulec compile`, or a file of limits or of a fleet where only
    that finds the mistake."""
    found = collect([folder])
    if not found:
        fleet, limits = folder / "fleet.yaml", folder / "limits.yaml"
        with pytest.raises(Refused) as refused:
            _ = read_fleet(fleet, compile_plant) if fleet.exists() else _limits(limits)
        found = list(refused.value.diagnostics)
    return render_all(found) + "\n"


def test_every_code_has_an_example_and_stands_on_the_page() -> None:
    """Codes in sources and schemas, examples and meanings are the same; docs/errors.md is made of
    the examples."""
    files = (*(ROOT / "rulec").rglob("*.py"), *(ROOT / "kb" / "schema").glob("*.json"))
    sources = (file.read_text(encoding="utf-8") for file in files)
    used = {code for text in sources for code in re.findall(r"KB\d{3}", text)}
    assert used == {name[:5] for name in EXAMPLES}
    assert used == set(MEANINGS)
    page = ROOT / "docs" / "errors.md"
    text = _page()
    if os.environ.get("RULEC_REMAKE"):
        page.write_text(text, encoding="utf-8")
    assert page.read_text(encoding="utf-8") == text


def _page() -> str:
    """One row per code: its meaning, and what its first example says and advises."""
    lines = [
        "# Errors",
        "",
        "The messages of `rulec check`, by code. Each names file, line and column, shows the",
        "line, and ends with a remedy. This page is made from the examples in `tests/errors/`",
        "(`RULEC_REMAKE=1 pytest tests/test_errors.py`); do not edit it.",
        "",
        "| code | meaning | example | remedy in the example |",
        "|---|---|---|---|",
    ]
    for code, meaning in MEANINGS.items():
        name = next(name for name in EXAMPLES if name.startswith(code))
        text = (ERRORS / name / "expected.txt").read_text(encoding="utf-8")
        said = re.sub(r"^\S+ \S+?: ", "", text.split("\n")[0])
        remedy = re.search(r"\^+ (.+)$", text, re.MULTILINE)
        cells = (code, meaning, said, remedy[1] if remedy else "")
        lines.append(f"| {' | '.join(map(_cell, cells))} |")
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    """Text in a table of Markdown: nothing in it is markup."""
    return re.sub(r"([\\|<>*_`\[\]])", r"\\\1", text)


def _kb(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the knowledge base to spoil, and a working folder beside it."""
    monkeypatch.chdir(folder)
    return Path(shutil.copytree(ROOT / "kb", folder / "kb")).relative_to(folder)


SPOILT = [
    ("sensors/piezoresistive.yaml", "title:", "titel:"),
    ("faults/leakage.yaml", "law: (1 - x)*g", "law: (1 - x)*g)"),
    ("modules/static-mixer.yaml", "unit: bar,", "unit: Bar,"),
    ("modules/static-mixer.yaml", "module: static-mixer", "module: static mixer"),
    ("modules/dosing-pcp.yaml", "unit: rpm, sensor", "unit: bar, sensor"),
    ("fluids/water.yaml", "A*exp(B/(T - C))", "A*exp(B/(T - C)))"),
    ("units.yaml", "units:", "unit:"),
]


@pytest.mark.parametrize(("file", "old", "new"), SPOILT)
def test_one_mistake_in_the_knowledge_base_is_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, old: str, new: str
) -> None:
    """What leans on a spoilt file is not blamed, in the knowledge base or in a plant."""
    kb = _kb(tmp_path, monkeypatch)
    for plant in ("abc", "cascaded-tanks"):
        shutil.copytree(ROOT / "plants" / plant, Path("plants") / plant)
    text = (kb / file).read_text(encoding="utf-8")
    (kb / file).write_text(text.replace(old, new, 1), encoding="utf-8")
    found = collect([kb, Path("plants")])
    assert [d.place.file for d in found] == [f"kb/{file}"], render_all(found)


PLANT = """\
plant: p
title: t
modules:
  A: {type: dosing-pcp}
"""


def test_a_plant_is_judged_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that only module types downstream provide sums to nothing; it is no mistake. Of an
    unknown module type connections, columns and calibration say nothing more. A check without a
    knowledge base must not pass."""
    plant = tmp_path / "plant.yaml"
    plant.write_text(PLANT, encoding="utf-8")
    assert collect([tmp_path]) == []
    plant.write_text(
        f"{PLANT.replace('pcp', 'pcq')}  C: {{type: static-mixer}}\n"
        "connections: [A -> C]\ncolumns: c.yaml\ncalibration: [k.yaml]"
    )
    (tmp_path / "c.yaml").write_text("columns: {A.dp: {from: x, unit: bar}}\n")
    (tmp_path / "k.yaml").write_text("calibration: p\nmodules: {A: {type: dosing-pcp}}\n")
    assert [d.code for d in collect([tmp_path])] == ["KB070"]
    monkeypatch.setenv("RULEC_KB", str(tmp_path / "none"))
    plant.write_text(PLANT, encoding="utf-8")
    assert [d.code for d in collect([plant])] == ["KB001"]


SHIPPED = sorted([*(ROOT / "kb").rglob("*.yaml"), *(ROOT / "plants").rglob("*.yaml")])
ODD: list[Any] = [None, True, -1, 1e308, 10**40, "", "a\n", "ü", "lambda", "1/0", "A" * 999, {}, []]
ODD += ["m**9", "degC/s", "../x", "\u2028", [[]], {"a": {}}, "A -> B", [1, 2], "x*g", "slope(dp)"]
BYTES = b"{}[]:,-#&*!|>'\"%@` \t\n\r.0e\x85\xc2\xff\x00?~"


def _mutant(rng: random.Random, raw: bytes) -> bytes:
    """A file with some bytes, lines, keys or values changed."""
    kind = rng.randrange(3)
    if kind == 0:
        text = bytearray(raw)
        for _ in range(rng.randint(1, 6)):
            at = rng.randrange(len(text))
            text[at : at + rng.choice([0, 1, 9])] = bytes(rng.choices(BYTES, k=rng.randint(0, 2)))
        return bytes(text)
    if kind == 1:
        lines = raw.splitlines(keepends=True)
        del lines[rng.randrange(len(lines))]
        return b"".join(rng.sample(lines, len(lines)) if rng.random() < 0.3 else lines)
    data = yaml.safe_load(raw)
    for _ in range(rng.randint(1, 3)):
        part, key = rng.choice(list(parts(data)) or [(data, "x")])
        if rng.random() < 0.4:
            del part[key]
        else:
            part[key] = rng.choice(ODD)
    return yaml.dump(data, sort_keys=False).encode()


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(n, marks=pytest.mark.prove) for n in range(1, 20))]
)
def test_mutated_files_give_diagnostics_only(tmp_path: Path, monkeypatch: Patch, seed: int) -> None:
    """No change of a shipped file leads to anything but messages."""
    _kb(tmp_path, monkeypatch)
    rng = random.Random(seed)
    for _ in range(15):
        source = rng.choice(SHIPPED)
        file = Path("plant.yaml" if "plants" in source.parts else "module.yaml")
        file.write_bytes(_mutant(rng, source.read_bytes()))
        text = render_all(collect([file]))
        assert all(c.isprintable() or c == "\n" for c in text)
        file.unlink()
