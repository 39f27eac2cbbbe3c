"""Decide which qualities are good, in the words and codes of historians, OPC DA and OPC UA."""

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rulec_runtime.contract.file_form import OPC_DA, OPC_UA, FileForm
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import Column, Unclear
from rulec_runtime.recordings.larger_than_memory import Growing

ONE_IS_GOOD = ("isgood", "is good", "good", "validity", "valid", "gültig", "gueltig")
"""Titles of columns in which 1 is good and 0 is not."""

_WORD = re.compile(r"(ok|valid|true|gut|gültig|normal)(?![a-z])")
_CODE = re.compile(r"[+-]?\d+(?:\.0*)?|0[xX][0-9a-fA-F]+")


def good_of(path: Path, title: str, found: Collection[str], form: FileForm) -> dict[str, bool]:
    """Whether each quality of a column is good.

    Raises `Unclear` if the meaning of codes depends on the standard.
    """
    if form.good and not {*form.good} <= {OPC_UA, OPC_DA}:
        wanted = {_plain(text) for text in form.good}
        return {text: _plain(text) in wanted for text in found}
    standard = form.good[0] if form.good else standard_of(path, title, found)
    return {text: _is_good(text, standard) for text in found}


def _plain(text: str) -> str | int:
    """A quality in comparable form: 1 and 1.0 are equal."""
    code = _code(text)
    return text.strip().lower() if code is None else code


def _is_good(text: str, standard: str) -> bool:
    """Whether a code is good, or a word: Good, Good (192), GoodLocalOverride, or none."""
    code = _code(text)
    if code is None:
        word = text.strip().lower()
        return not word or word.startswith("good") or _WORD.match(word) is not None
    if standard == OPC_UA:
        return code % 2**32 < 2**30
    if standard == OPC_DA:
        return limits.GOOD_QUALITY <= code <= 255
    return code == 1


def standard_of(path: Path, title: str, found: Collection[str]) -> str:
    """The standard of the codes in a column: 1 if that means good, empty if it has no codes. Raises
    `Unclear` if 0 could be good or bad."""
    codes = {code for code in map(_code, found) if code is not None}
    if not codes:
        return ""
    if max(codes) > 255 or min(codes) < 0:
        return OPC_UA
    if codes <= {0, 1} and title.strip().lower() in ONE_IS_GOOD:
        return "1"
    if max(codes) >= limits.GOOD_QUALITY:
        return OPC_DA
    shown = ", ".join(map(str, sorted(codes)[:4]))
    only = "every quality is 0, which" if codes == {0} else f"qualities are {shown}, and 0"
    raise Unclear(
        f"{path}: {only} is good in OPC UA and bad in OPC DA; say which in the column map, as in "
        f"'file: {{good: {OPC_UA}}}', '{{good: {OPC_DA}}}' or '{{good: [1]}}'",
        [{"good": (OPC_UA,)}, {"good": (OPC_DA,)}, {"good": ("1",)}],
        likely=False,
    )


MEANINGS = {
    OPC_UA: "codes of OPC UA",
    OPC_DA: "codes of OPC DA, good from 192 on",
    "1": "1 for good",
}


def codes_remark(path: Path, title: str, found: Collection[str], form: FileForm) -> tuple[str, ...]:
    """The remark on codes whose standard the column map does not name."""
    standard = "" if form.good else standard_of(path, title, found)
    return (f"'{title.strip()}' holds {MEANINGS[standard]}",) if standard else ()


def _code(text: str) -> int | None:
    text = text.strip()
    if not _CODE.fullmatch(text):
        return None
    return int(text, 16) if text[:2] in ("0x", "0X") else int(float(text))


def judged(
    path: Path,
    column: Column,
    title: str,
    texts: Sequence[str],
    found: Collection[str],
    form: FileForm,
) -> Column:
    """A column in which bad qualities replace the numbers, as words do. `found` are all qualities
    in the file: one column alone may not show their standard."""
    good = good_of(path, title, found, form)
    values, parts = column.numbers().copy(), Growing()
    for row in (k for k, text in enumerate(texts) if not good[text]):
        if np.isfinite(values[row]):
            column.say(row, as_word(texts[row]))
        values[row] = np.nan
    parts.append(values)
    return replace(column, parts=parts)


def as_word(text: str) -> str:
    """A quality as the word that replaces a reading.

    >>> as_word("Bad"), as_word("0")
    ('Bad', 'quality 0')
    """
    text = text.strip()[:30]
    return text if text[:1].isalpha() else f"quality {text}"
