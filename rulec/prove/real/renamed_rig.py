"""The same rig under other names: modules, columns and titles; the answer must not change.

New names are in the opposite order of the old ones, to reveal any dependence on that order.
"""

import copy
import csv
import io
import json
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rulec_runtime.output.write_file import write_text

from rulec.prove.real.rig_folder import PLANT, open_text, write_packed, write_yaml, yaml_of

SAME = 1e-6
"""Relative difference below which numbers are the same, as sums in another order are rounded
differently. Origin: numerical."""

_OF_EFFECTS = ("effect", "place", "probability", "class_probability")

Names = Mapping[str, str]


def hide(folder: Path) -> dict[str, str]:
    """Rename everything in a rig's working folder; returns new names of modules by old ones."""
    plant = folder / "plant"
    data = copy.deepcopy(yaml_of(plant / PLANT))
    old = list(data["modules"])
    modules = {name: f"N{len(old) - i:03d}" for i, name in enumerate(sorted(old))}
    for entry in data["modules"].values():
        entry.pop("title", None)
        for value in entry.get("parameters", {}).values():
            value["source"] = "hidden"
    data["modules"] = {modules[n]: entry for n, entry in data["modules"].items()}
    data |= {"plant": "hidden", "title": "Hidden"}
    if "connections" in data:
        data["connections"] = [_renamed(text, modules) for text in data["connections"]]
    write_yaml(plant / PLANT, data)
    for name in data.get("calibration", ()):
        found = yaml_of(plant / name)
        renamed = {modules[n]: m for n, m in found["modules"].items()}
        write_yaml(plant / name, {**found, "modules": renamed})
    if "adjacency" in data:
        matrix = plant / data["adjacency"]
        write_text(matrix, _renamed(matrix.read_text(encoding="utf-8"), modules))
    titles = _hide_columns(plant / data["columns"], modules) if "columns" in data else {}
    for file in (*folder.glob("*.csv"), *folder.glob("*.csv.gz")):
        with open_text(file) as source:
            header, *rows = csv.reader(source)
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(titles.get(t) or _other_title(t, modules, i) for i, t in enumerate(header))
        writer.writerows(rows)
        write_packed(file, out.getvalue())
    return modules


def differences(open_: Mapping[str, Any], masked: Mapping[str, Any], modules: Names) -> list[str]:
    """Return the differences of an answer under other names, each with its place in the JSON."""
    back = {new: old for old, new in modules.items()}
    renamed = json.loads(_renamed(json.dumps(masked), back))
    return list(_differ(_compared(open_), _compared(renamed), ""))


def _hide_columns(file: Path, modules: Names) -> dict[str, str]:
    """Rename in a column map; returns new titles by old ones."""
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
    """New title of a column outside the map: a signal of the plant, the time, or unknown."""
    word = title.partition(".")[0]
    if word in modules:
        return modules[word] + title[len(word) :]
    return title if title.split(" ")[0] == "time" else f"y{number}"


def _renamed(text: str, names: Names) -> str:
    """Replace every whole word that is a name."""
    return re.sub(r"[A-Za-z]\w*", lambda word: names.get(word.group(), word.group()), text)


def _compared(form: Mapping[str, Any]) -> dict[str, Any]:
    """The parts of an answer to compare, without texts and the order of equals."""
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
