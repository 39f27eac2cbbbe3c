"""The same rig under other names: modules, columns and titles; an answer must not change.

New names are in the opposite order of the old ones, so that an order by name shows.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rulec_runtime.output.write_file import write_text

from rulec.prove.real.files import opened, write_packed, write_yaml, yaml_of
from rulec.prove.real.form import PLANT

SAME = 1e-6
"""Numbers that differ by less, relatively, are the same: sums in another order are rounded
otherwise. Origin: numerical."""

TIME = "time"
_OF_EFFECTS = ("effect", "place", "probability", "class_probability")

Names = Mapping[str, str]


def hide(folder: Path) -> dict[str, str]:
    """Rename in a folder that is laid out; returns the modules' new names by the old ones."""
    plant = folder / "plant"
    data = yaml_of(plant / PLANT)
    old = list(data["modules"])
    modules = {name: f"N{len(old) - i:03d}" for i, name in enumerate(sorted(old))}
    data["modules"] = {modules[n]: _untitled(entry) for n, entry in data["modules"].items()}
    data |= {"plant": "hidden", "title": "Hidden"}
    if "connections" in data:
        data["connections"] = [_renamed(text, modules) for text in data["connections"]]
    write_yaml(plant / PLANT, data)
    for name in data.get("calibration", ()):
        found = yaml_of(plant / name)
        write_yaml(
            plant / name, {**found, "modules": {modules[n]: m for n, m in found["modules"].items()}}
        )
    if "adjacency" in data:
        matrix = plant / data["adjacency"]
        write_text(matrix, _renamed(matrix.read_text(encoding="utf-8"), modules))
    titles = _hide_columns(plant / data["columns"], modules) if "columns" in data else {}
    _rewrite_recordings(folder, modules, titles)
    return modules


def rename_titles(header: list[str], modules: Names, titles: Names) -> list[str]:
    """New titles of a recording's columns; units in brackets stay."""
    return [titles.get(t) or _other_title(t, modules, number) for number, t in enumerate(header)]


def differences(open_: Mapping[str, Any], hidden: Mapping[str, Any], modules: Names) -> list[str]:
    """What an answer says otherwise under other names, each with its place in the JSON."""
    back = {new: old for old, new in modules.items()}
    one, other = (_compared(form) for form in (open_, _back(hidden, back)))
    return list(_differ(one, other, ""))


def _retitle(file: Path, modules: Names, titles: Names) -> None:
    """Give the columns of a recording other titles."""
    with opened(file) as source:
        rows = csv.reader(source)
        header, out = next(rows), io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(rename_titles(header, modules, titles))
        writer.writerows(rows)
    write_packed(file, out.getvalue())


def _rewrite_recordings(folder: Path, modules: Names, titles: Names) -> None:
    for file in (*folder.glob("*.csv"), *folder.glob("*.csv.gz")):
        _retitle(file, modules, titles)


def _hide_columns(file: Path, modules: Names) -> dict[str, str]:
    """Rename in a column map; returns new titles by the old ones."""
    data, titles = yaml_of(file), {}
    columns = {}
    for number, (signal, entry) in enumerate(data["columns"].items()):
        given = entry["from"]
        for part, title in enumerate([given] if isinstance(given, str) else given):
            unit = re.search(r"\s*\[[^\]]*\]$", title)
            titles[title] = f"x{number}{'abc'[part]}{unit.group() if unit else ''}"
        new = titles[given] if isinstance(given, str) else [titles[t] for t in given]
        columns[_other_title(signal, modules, number)] = {**entry, "from": new}
    write_yaml(file, {**data, "columns": columns})
    return titles


def _other_title(title: str, modules: Names, number: int) -> str:
    """Of a column that no map has: a signal of the plant, the time, or a stranger."""
    word = title.partition(".")[0]
    if word in modules:
        return modules[word] + title[len(word) :]
    return title if title.split(" ")[0] == TIME else f"y{number}"


def _untitled(entry: Mapping[str, Any]) -> dict[str, Any]:
    """A module without its title, its values without their sources."""
    found = {key: value for key, value in entry.items() if key != "title"}
    if "parameters" in found:
        values = found["parameters"].items()
        found["parameters"] = {name: {**value, "source": "hidden"} for name, value in values}
    return found


def _renamed(text: str, names: Names) -> str:
    """Every whole word that is a name, replaced."""
    return re.sub(r"[A-Za-z]\w*", lambda word: names.get(word.group(), word.group()), text)


def _back(data: Any, names: Names) -> Any:
    if isinstance(data, Mapping):
        return {_renamed(k, names): _back(v, names) for k, v in data.items()}
    if isinstance(data, list):
        return [_back(entry, names) for entry in data]
    return _renamed(data, names) if isinstance(data, str) else data


def _compared(form: Mapping[str, Any]) -> dict[str, Any]:
    """What an answer is made of; words and the order of equals are left out."""
    effects = {e["id"]: {key: e[key] for key in _OF_EFFECTS} for e in form["effects"]}
    for e in form["effects"]:
        effects[e["id"]]["alternatives"] = {a["id"]: a["probability"] for a in e["alternatives"]}
        parameters = e["parameters"].items()
        effects[e["id"]]["parameters"] = {k: [v["value"], v["u"]] for k, v in parameters}
        effects[e["id"]]["modules"] = sorted(e["modules"])
    places = {f"{p['module']}.{p['place']}": p["share"] for p in form["locations"]}
    errors = {fit["signal"]: fit["heldout"] for fit in form.get("fits") or ()}
    return {"verdict": form["verdict"], "effects": effects, "locations": places, "fits": errors}


def _differ(one: Any, other: Any, path: str) -> Iterator[str]:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for key in sorted({*one, *other}):
            yield from _differ(one.get(key), other.get(key), f"{path}.{key}".lstrip("."))
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, pair in enumerate(zip(one, other, strict=True)):
            yield from _differ(*pair, f"{path}[{number}]")
    elif isinstance(one, float) and isinstance(other, float):
        if not math.isclose(one, other, rel_tol=SAME, abs_tol=SAME):
            yield f"{path}: {one:.6g} → {other:.6g}"
    elif one != other:
        yield f"{path}: {_short(one)} → {_short(other)}"


def _short(value: Any) -> str:
    return (
        "absent" if value is None else "there" if isinstance(value, Mapping | list) else str(value)
    )
