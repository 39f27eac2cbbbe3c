"""Checked documents to plain data and back.

Files are named relative to their folder: the paths that messages show depend on where the tool
runs, and are made anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rulec.knowledge.layers import layers_of, plant_file
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Place
from rulec.language.document import Document, Path_, display


def sources_form(sources: Sources) -> dict[str, Any]:
    """All documents of a plant as JSON data."""
    assert sources.plant is not None
    named = sources.plant.data
    calibrations = zip(named.get("calibration", ()), sources.calibrations, strict=True)
    return {
        "plant": _document(sources.plant),
        "columns": sources.columns and _document(sources.columns, file=named["columns"]),
        "calibrations": [_document(d, file=name) for name, d in calibrations],
        "adjacency": sources.adjacency,
        "knowledge": [
            [
                kind,
                [
                    _document(d, layer=sources.layers.index(layer), file=layer.inside(d.path))
                    for d in documents
                    for layer in [sources.layer_of[d.path]]
                ],
            ]
            for kind, documents in sources.by_kind.items()
        ],
    }


def sources_from(form: Mapping[str, Any], plant: Path) -> Sources:
    """The documents of a plant (folder or file) from their JSON data.

    Raises `Refused` if a folder of knowledge is missing.
    """
    file = plant_file(plant)
    own = _of(form["plant"], file)
    names = own.data.get("kb", [])
    folders = [names] if isinstance(names, str) else names
    layers = layers_of(file.parent, [(name, own.place("kb")) for name in folders])
    by_kind, layer_of = {}, {}
    for kind, documents in form["knowledge"]:
        found = []
        for part in documents:
            layer = layers[part["layer"]]
            document = _of(part, layer.folder / part["file"])
            layer_of[document.path] = layer
            found.append(document)
        by_kind[kind] = tuple(found)
    columns = form["columns"]
    return Sources(
        layers=layers,
        by_kind=by_kind,
        layer_of=layer_of,
        plant=own,
        columns=columns and _of(columns, file.parent / columns["file"]),
        calibrations=tuple(_of(part, file.parent / part["file"]) for part in form["calibrations"]),
        adjacency=form["adjacency"] and tuple(form["adjacency"]),
    )


def _document(document: Document, **where: Any) -> dict[str, Any]:
    return {
        **where,
        "label": document.label,
        "data": document.data,
        "values": [(path, p.line, p.column, p.length) for path, p in document.values.items()],
        "keys": [(path, p.line, p.column, p.length) for path, p in document.keys.items()],
    }


def _of(form: Mapping[str, Any], file: Path) -> Document:
    name = display(file)

    def places(key: str) -> dict[Path_, Place]:
        return {tuple(path): Place(name, *position) for path, *position in form[key]}

    return Document(name, form["label"], form["data"], places("values"), places("keys"))
