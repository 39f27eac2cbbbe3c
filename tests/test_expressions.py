"""Hostile and malformed equations, names and files end in a message; nothing is evaluated."""

import builtins
import json
import os
import shutil
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import sympy

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.language.diagnostics import Diagnostic, render_all
from rulec.language.expression import Rejected, parse
from rulec.language.read_yaml import parse_document
from tests.conftest import ROOT

CANARY = "RULEC_CANARY"

# text, code, column from 0
REFUSED: list[tuple[str, str, int]] = [
    # code that would run in eval, and in sympy's readers
    ("__import__('os').environ.update(RULEC_CANARY='1')", "KB040", 11),
    ("eval(n)", "KB044", 0),
    ("().__class__.__base__.__subclasses__()", "KB041", 0),
    ("lambda: 0", "KB040", 6),
    ("(lambda x: x)(n)", "KB040", 9),
    ("n(1)(2)", "KB041", 0),
    ("n[0]", "KB040", 1),
    ("[x for x in n]", "KB040", 0),
    ("{n: n}", "KB040", 0),
    ("'n'", "KB040", 0),
    ("f'{n}'", "KB040", 1),
    ("(n := 1)", "KB040", 3),
    ("import os", "KB024", 0),
    ("n if dp else 1", "KB024", 2),
    ("n < dp", "KB040", 2),
    ("sqrt(*n)", "KB041", 5),
    ("min(n, dp, key=abs)", "KB040", 14),
    # work without end
    ("9**9**9**9", "KB043", 9),
    ("n**99999999", "KB043", 3),
    ("(n**8)**8", "KB043", 4),
    ("factorial(10**7)", "KB044", 0),
    ("exp(exp(exp(99)))", "KB041", 8),
    ("1e999", "KB041", 0),
    ("n**" + "9" * 400, "KB043", 3),
    ("n*" * 1000 + "n", "KB042", 0),
    ("(" * 250 + "n" + ")" * 250, "KB042", 200),
    ("+".join("n" * 60), "KB042", 0),
    # numbers that are none
    ("1/0", "KB041", 2),
    ("n/(2 - 2)", "KB041", 3),
    ("sqrt(1 - 2)", "KB041", 0),
    ("2j*n", "KB041", 0),
    # what is hard to see
    ("n\0", "KB040", 1),
    ("n\x1b[31m", "KB040", 1),
    ("n # dp", "KB040", 2),
    ("n \\\n + dp", "KB040", 2),
    ("ｎ + 1", "KB040", 0),
    ("n − dp", "KB040", 2),
    ("n\u200b", "KB040", 1),
    ("n" * 42, "KB041", 0),
    # slips
    ("", "KB040", 0),
    ("2n", "KB040", 0),
    ("n)", "KB040", 1),
    ("0,5*n", "KB041", 1),
    ("  n, dp", "KB041", 3),
    ("()", "KB041", 0),
    ("n**dp", "KB043", 3),
    ("n**(1/0)", "KB043", 4),
    ("sqr(n)", "KB044", 0),
    ("sqrt()", "KB045", 0),
    # downstream
    ("downstream()", "KB045", 0),
    ("downstream(2*n)", "KB045", 0),
    ("downstream(downstream(n))", "KB045", 0),
    ("downstream(*n)", "KB041", 11),
]


WATCHED = [
    *((os, name) for name in ("system", "popen", "putenv")),
    *((sympy, name) for name in ("sympify", "lambdify")),
    *((builtins, name) for name in ("eval", "exec", "open", "print", "input")),
]


@pytest.mark.parametrize(("text", "code", "column"), REFUSED, ids=[t[:40] for t, _, _ in REFUSED])
def test_hostile_equation_is_refused_unread(
    monkeypatch: pytest.MonkeyPatch, text: str, code: str, column: int
) -> None:
    """Refused with code and column; nothing was evaluated, opened, imported or started."""
    ran: list[str] = []
    really_import = builtins.__import__

    def imported(name: str, *rest: Any, **more: Any) -> ModuleType:
        ran.extend([name] if name != "collections" else [])  # ast.walk needs that
        return really_import(name, *rest, **more)

    with monkeypatch.context() as patch:
        for module, name in WATCHED:
            patch.setattr(module, name, lambda *_, name=name, **__: ran.append(name))
        patch.setattr(builtins, "__import__", imported)
        with pytest.raises(Rejected) as refused:
            parse(text)
    assert (refused.value.code, refused.value.column) == (code, column)
    assert refused.value.message
    assert ran == []
    assert CANARY not in os.environ


MODULE = """\
module: hostile
version: 1
title: A pump
signals:
  {signal}: {{quantity: rotational speed, unit: rpm, sensor: converter-speed, reference: 900}}
parameters:
  V: {{value: 10, unit: ml/rev, u: 0.1, source: data sheet}}
observers:
  pump: {{component: pump, Q: {equation}, source: displacement}}
"""


@pytest.fixture(scope="module")
def small_kb(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As little of the shipped knowledge base as `MODULE` needs."""
    kb = tmp_path_factory.mktemp("kb")
    sensors = ("sensors/converter-speed.yaml", "sensors/piezoresistive.yaml")
    for file in ("units.yaml", *sensors, "modules/static-mixer.yaml"):
        shutil.copy(ROOT / "kb" / file, kb)
    mixer = (kb / "static-mixer.yaml").read_text(encoding="utf-8")
    (kb / "static-mixer.yaml").write_text(mixer.split("faults:")[0], encoding="utf-8")
    return kb


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small_kb: Path) -> Path:
    """An empty working folder with a knowledge base elsewhere."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RULEC_KB", str(small_kb))
    return tmp_path


def _check(path: Path, content: str | bytes) -> list[Diagnostic]:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return collect([Path(path.name)])


NAMES = ["__class__", "os.system('x')", "n n", "1n", "n\n", "", "ｎ", "n" * 42, "lambda", "None"]


@pytest.mark.parametrize("name", NAMES)
def test_hostile_name_is_refused_once(here: Path, name: str) -> None:
    """A name that is code, or that no equation can read, is told where it is declared."""
    equation = name if name.isidentifier() and name.isascii() else "1*n"
    module = MODULE.format(signal=json.dumps(name), equation=json.dumps(f"V*{equation}"))
    (found,) = _check(here / "m.yaml", module)
    assert (found.code, found.place.line, found.place.column) == ("KB024", 5, 3)


def test_paths_that_cannot_be_read_give_diagnostics(here: Path) -> None:
    """A loop of links, a device without end."""
    (here / "loop.yaml").symlink_to(here / "loop.yaml")
    for path in ("loop.yaml", "/dev/zero"):
        assert [d.code for d in collect([Path(path)])] == ["KB001"]


@pytest.mark.parametrize("key", ["columns", "adjacency", "kb", "calibration"])
@pytest.mark.parametrize(
    ("name", "code"),
    [("no.yaml", "KB001"), ("a\0b", "KB014"), ("x" * 5000, "KB001"), (".", "KB001")],
)
def test_hostile_path_in_a_plant_gives_one_diagnostic(
    here: Path, key: str, name: str, code: str
) -> None:
    """A plant names files; none of these can be read."""
    value = json.dumps([name] if key == "calibration" else name)
    plant = f"plant: p\ntitle: t\nmodules: {{A: {{type: static-mixer}}}}\n{key}: {value}\n"
    (found,) = _check(here / "plant.yaml", plant)
    assert (code, 4) == (found.code, found.place.line)


CORE: dict[str, object] = {
    "1e-3": 0.001, "1e3": 1000.0, "no": "no", "12:30": "12:30", "0o14": "0o14", "014": 14,
    "0x1F": "0x1F", "1_000": "1_000", "2025-01-01": "2025-01-01", "=": "=", "+.5": 0.5, "1.": 1.0,
    "'true'": "true", "True": True, "~": None, "1e-3\r\nb: 2\r\n": 0.001,
}  # fmt: skip


def test_scalars_are_read_by_yaml_1_2() -> None:
    """None of the traps of YAML 1.1: sexagesimal, octal, yes and no, text for 1e-3."""
    for text, value in CORE.items():
        document, found = parse_document("m.yaml", f"value: {text}")
        assert not found
        assert document is not None
        assert (type(value), value) == (type(document.data["value"]), document.data["value"])


def test_places_are_right_and_output_is_bounded(here: Path) -> None:
    """With a byte order mark and any line ends the column of a mistake is the one an editor
    shows. Ten thousand mistakes are counted, not printed; a long line is cut around the caret."""
    text = "fluid: 5\ntitle: a\nvalid: {}\ncoefficients: {}\ndensity: {}\nviscosity: {}\n"
    for content in (text, "\ufeff" + text, text.replace("\n", "\r\n"), text.replace("\n", "\r")):
        first = _check(here / "m.yaml", content)[0]
        assert (first.code, first.place.line, first.place.column) == ("KB022", 1, 8)
        assert "    1 | fluid: 5\n      |        ^ put it in quotes" in render_all([first])
    names = ", ".join(f"s{i}: {{}}" for i in range(1000))
    found = _check(here / "m.yaml", f"module: a\nversion: 1\ntitle: t\nsignals: {{{names}}}\n")
    assert len(found) == 1000
    assert len(render_all(found)) < 30_000
    assert all(len(line) < 500 for line in render_all(found).splitlines())


SHELL = {
    "module.yaml": MODULE.format(signal="n", equation="\"__import__('os').system('x')\"").encode(),
    "binary.yaml": bytes(range(256)),
    "escape.yaml": b'module: "\\e[31mred\\a"\n',
    "markup.yaml": b'module: red\nversion: ":bug: [red]x[/red]"\n',
    "bomb.yaml": b"a: &a [x]\nb: [*a, *a]\n",
}


def test_command_line_ends_with_a_message(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 1, a message for each file."""
    for name, content in SHELL.items():
        (here / name).write_bytes(content)
    names = [*SHELL, "missing.yaml"]
    assert main(["check", *names]) == 1
    out, aside = capsys.readouterr()
    assert aside == ""
    assert all(f" {name}:" in out for name in names)
    assert "\x1b" not in out
    assert ":bug: [red]x[/red]" in out
