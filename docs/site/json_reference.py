"""The page of JSON outputs: the keys of what the commands write for shipped examples."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rulec.cli import main

ROOT = Path(__file__).parents[2]
PLANT = ROOT / "plants" / "abc"
EXAMPLES = PLANT / "examples"
DEEP = 5
"""Levels of keys that are shown."""
SHOWN = 40
"""Characters of an example."""
DIGITS = 4
"""Digits of a number in an example."""
NAME = "NAME"
"""Stands for a name of the plant."""


def commands(folder: Path) -> dict[str, list[str]]:
    """Commands with a JSON form that are quick on a shipped example, and all of their arguments."""
    found = str(folder / "found.json")
    mtp = ROOT / "plants" / "dosing-line" / "examples" / "dosing.aml"
    calibration = ["calibrate", str(PLANT), str(EXAMPLES / "calibration.csv")]
    return {
        "matrix PLANT": ["matrix", str(PLANT), "--json", found],
        "diagnose PLANT RECORDING": [
            *("diagnose", str(PLANT), str(EXAMPLES / "leakage_A.csv"), "--json", found)
        ],
        "calibrate PLANT RECORDING -o FILE": [
            *(*calibration, "-o", str(folder / "calibration.yaml"), "--json", found)
        ],
        "import mtp FILE -o DIR": [
            *("import", "mtp", str(mtp), "-o", str(folder / "imported"), "--json", found)
        ],
    }


def json_page() -> str:
    """Markdown with a section per command: a table of its keys."""
    parts = [
        "# JSON",
        "Keys that `--json FILE` writes, each with an example from a shipped recording; `[]` stands"
        " for each entry of a list, `NAME` for names of the plant. What `rulec mismatch` writes is"
        " explained in [Repair a model](../repair-a-model.md#options), what `rulec watch` tells in"
        " [Watch a plant](../watch-a-plant.md).",
    ]
    for title, data in _written():
        rows = [f"| `{path}` | {kind} | {_example(value)} |" for path, kind, value in _walk(data)]
        parts += [f"## rulec {title}"]
        parts.append("\n".join(["| key | value | example |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


def _written() -> Iterator[tuple[str, Any]]:
    with TemporaryDirectory() as name:
        for title, arguments in commands(Path(name)).items():
            with contextlib.redirect_stdout(io.StringIO()):
                code = main([*arguments, "--quiet"])
            if code:
                raise RuntimeError(f"rulec {' '.join(arguments)} failed")
            yield title, json.loads((Path(name) / "found.json").read_text(encoding="utf-8"))


def _walk(data: Any, path: str = "", deep: int = 0) -> Iterator[tuple[str, str, Any]]:
    """Keys below a value, their kinds, and a value of each; entries of a list are one."""
    if isinstance(data, dict) and deep < DEEP:
        for key, value in _named(data).items():
            here = f"{path}.{key}" if path else key
            yield here, _kind(value), value
            yield from _walk(value, here, deep + 1)
    elif isinstance(data, list):
        entries = [entry for entry in data if isinstance(entry, dict)]
        yield from _walk(_merged(entries), f"{path}[]", deep)


def _merged(entries: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """All keys of several entries, each with the first value that is there."""
    found: dict[str, Any] = {}
    for entry in entries:
        found |= {key: value for key, value in entry.items() if key not in found}
    return found


def _named(data: dict[str, Any]) -> dict[str, Any]:
    """Entries that are alike, under names of the plant, as one of them."""
    entries = list(data.values())
    alike = len(entries) > 1 and all(isinstance(entry, dict) and entry for entry in entries)
    if alike and set.intersection(*map(set, entries)):
        return {NAME: _merged(entries)}
    return data


def _kind(value: Any) -> str:
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, list):
        return "list"
    if isinstance(value, dict):
        return "keys"
    return {str: "text", type(None): "null"}.get(type(value), "number")


def _example(value: Any) -> str:
    """A short value as it is written; nothing for what has keys of its own."""
    if isinstance(value, dict) or (isinstance(value, list) and any(map(_has_keys, value))):
        return ""
    number = isinstance(value, float)
    text = f"{value:.{DIGITS}g}" if number else json.dumps(value, ensure_ascii=False)
    return f"`{text if len(text) <= SHOWN else text[: SHOWN - 1] + '…'}`".replace("|", "\\|")


def _has_keys(value: Any) -> bool:
    return isinstance(value, dict)
