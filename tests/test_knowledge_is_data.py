"""No Python file names a pump, a fault, a fluid, a sensor class or an effect: they stand in kb/.

Names of kb/ are looked for in identifiers and in strings, whole words; not in docstrings.
"""

import ast
import functools
import re
from collections.abc import Iterator

from tests.conftest import ROOT, plain_yaml

KINDS = ("module", "fault", "fluid", "sensor", "effect")
FILES = sorted(
    path.relative_to(ROOT).as_posix()
    for package in ("rulec", "runtime")
    for path in (ROOT / package).rglob("*.py")
    if "prove" not in path.parts  # plants the effects that the tool must find
)
WORD = re.compile(r"[A-Za-z][A-Za-z0-9]*(?:[-_][A-Za-z0-9]+)*")


@functools.cache
def known_names() -> set[str]:
    """Names of all entries of kb/, and of components, and such as ``P_el`` and ``dp_mix``."""
    names: set[str] = set()
    for data in map(plain_yaml, (ROOT / "kb").rglob("*.yaml")):
        kind = next(iter(data))
        if kind in KINDS:
            own = (*data.get("signals", ()), *data.get("definitions", ()))
            names |= {data[kind], *data.get("provides", ()), *(name for name in own if "_" in name)}
            names |= {part["component"] for part in data.get("observers", {}).values()}
    return {name.replace("-", "_").lower() for name in names}


def words(file: str) -> Iterator[tuple[int, str]]:
    """Identifiers and words in strings, with their lines; docstrings left out."""
    nodes = [*ast.walk(ast.parse((ROOT / file).read_text(encoding="utf-8")))]
    bare = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        found = [getattr(node, field, None) for field in ("id", "attr", "arg", "name")]
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in bare:
            found = WORD.findall(node.value)
        yield from ((node.lineno, word) for word in found if isinstance(word, str))


@functools.cache
def named(word: str) -> set[str]:
    """Entries that a word names: as a whole, or as a part of a compound identifier."""
    plain = word.replace("-", "_").lower()
    parts = plain.split("_")
    runs = {"_".join(parts[i:j]) for i in range(len(parts)) for j in range(i + 1, len(parts) + 1)}
    plural = {run.removesuffix("s") for run in runs}
    return (runs | plural) & known_names()


def test_names_are_recognised() -> None:
    """The test would pass on an empty kb/ too."""
    for word, expected in (
        ("leakage", {"leakage"}), ("find_leakages", {"leakage"}), ("dosing-pcp", {"dosing_pcp"}),
        ("P_el", {"p_el"}), ("slope_gradients", {"slope"}), ("waterfall", set()),
    ):  # fmt: skip
        assert expected == named(word)
    assert {"piezoresistive", "water", "pump", "dp_mix"} <= known_names()


ALLOWED = {
    "slope": "the slope of an observer is mathematics; a fault is named after it",
    "offset": "the zero of a unit and of a column are offsets; a fault is named after them",
    "overflow": "what a page does with text that is too long; an effect is named so",
    "line": "a line of a file; a component is called so too",
}


def test_no_code_names_knowledge() -> None:
    """Whole words in identifiers and strings against the names of kb/."""
    names = [
        f"{file}:{line}: {word}"
        for file in FILES
        for line, word in words(file)
        if named(word) - set(ALLOWED)
    ]
    assert [] == names
