"""Titles of columns in sheets, and tolerances of acceptance grades, from `words.yaml`."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from rulec.curves.sheet import CurveRefused
from rulec.knowledge.module_type import Accuracy
from rulec.language.units import Dimension

_FILE = Path(__file__).with_name("words.yaml")

_GIVES = {
    "flow": (Dimension.of({"m": 3, "s": -1}),),
    "head": (Dimension.of({"m": 1}), Dimension.of({"kg": 1, "m": -1, "s": -2})),
    "power": (Dimension.of({"kg": 1, "m": 2, "s": -3}), Dimension.of({"kg": 1, "m": 2, "s": -2})),
}
"""Dimensions by the word of a grade: head may also be a pressure, power a torque."""


@dataclass(frozen=True)
class Grade:
    """A tolerance: shares by word (see `_GIVES`), or one `share` of everything."""

    name: str
    shares: Mapping[str, float]
    source: str

    def of(self, dimension: Dimension) -> Accuracy | None:
        """The tolerance of a quantity; None if the grade does not cover it."""
        for word, share in self.shares.items():
            if not _GIVES.get(word) or any(dimension.fits(d) for d in _GIVES[word]):
                return Accuracy(share, self.source)
        return None


def grade_of(text: str) -> Grade:
    """A grade by its name, or by a share and its source, as in ``10 %, IEC 60534-2-4``.

    Raises `CurveRefused`.
    """
    known: Mapping[str, Any] = _words()["grades"]
    if text in known:
        entry = dict(known[text])
        source = str(entry.pop("source"))
        return Grade(text, {word: share / 100.0 for word, share in entry.items()}, source)
    share, percent, source = text.partition("%")
    try:
        value = float(share) / 100.0
    except ValueError:
        value = -1.0
    if not (percent and 0.0 < value < 1.0 and source.strip(" ,")):
        raise CurveRefused(
            f"--grade '{text[:40]}': give {', '.join(known)}, or a share with its source, "
            "as in '10 %, IEC 60534-2-4'"
        )
    return Grade(f"{100 * value:g} %", {"": value}, source.strip(" ,"))


def role_of(name: str) -> str:
    """The role of a column by its name, where its unit cannot tell; else empty.

    >>> role_of("Eta"), role_of("Q")
    ('efficiency', '')
    """
    return next((role for role, names in _words()["roles"].items() if name.lower() in names), "")


@functools.cache
def _words() -> Any:
    return yaml.safe_load(_FILE.read_text(encoding="utf-8"))
