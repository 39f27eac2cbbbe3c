"""All documents that a plant or a check needs: their hashes and units."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rulec.knowledge.layers import Layer
from rulec.language.diagnostics import Diagnostic
from rulec.language.read_yaml import Document
from rulec.language.units import UnitTable, unit_table


@dataclass(frozen=True)
class LayerDocuments:
    """The content of a layer: documents by kind, and mistakes of form."""

    layer: Layer
    by_kind: dict[str, list[Document]] = field(default_factory=dict)
    mistakes: list[Diagnostic] = field(default_factory=list)

    def ids(self) -> Iterator[str]:
        """Names for use in other files: of types, faults, sensors, fluids, units, quantities."""
        for kind, documents in self.by_kind.items():
            for document in documents:
                if kind == "units":
                    for group in ("units", "quantities"):
                        yield from document.data.get(group, ())
                elif kind in document.data:
                    yield str(document.data[kind])


@dataclass(frozen=True, kw_only=True)
class Sources:
    """All documents that a plant or a check needs, by kind; they conform to their schemas.

    `contents` are those of the folders of knowledge that were read. Module types that the plant
    does not have are of the kind ``provider`` if its modules may use their provided names. The
    others, and fluids that it does not have, are of the kind ``other``, unchecked, for their names.
    `given` are the documents to be checked.
    """

    contents: tuple[LayerDocuments, ...]
    by_kind: Mapping[str, tuple[Document, ...]]
    plant: Document | None = None
    columns: Document | None = None
    calibrations: tuple[Document, ...] = ()
    adjacency: tuple[str, str] | None = None
    given: tuple[Document, ...] = ()

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The folders of knowledge that were read."""
        return tuple(part.layer for part in self.contents)

    @property
    def units(self) -> tuple[Document, ...]:
        """Lists of units."""
        return self.by_kind.get("units", ())

    def counting(self) -> list[Document]:
        """Documents of knowledge that a ruleset depends on."""
        kinds = ("module", "fault", "sensor", "fluid", "units")
        return [document for kind in kinds for document in self.by_kind.get(kind, ())]

    def digest(self) -> str:
        """Hash of everything a ruleset depends on, independent of layout and order."""
        parts = [self.plant, self.columns, *self.calibrations, *self.units, *self.counting()]
        return digest_of(parts, self.adjacency[1] if self.adjacency else "")

    def by_layer(self) -> dict[Layer, list[tuple[str, Document]]]:
        """Kinds and documents of each layer, including empty layers."""
        return {
            part.layer: [(kind, d) for kind, found in part.by_kind.items() for d in found]
            for part in self.contents
        }

    def made_from(self) -> tuple[tuple[Layer, str], ...]:
        """Layers that a ruleset depends on, each with the hash of what it takes from there."""
        counting = {document.path for document in self.counting()}
        taken = {
            layer: [document for _, document in documents if document.path in counting]
            for layer, documents in self.by_layer().items()
        }
        return tuple((layer, digest_of(own)) for layer, own in taken.items() if own)

    def connected(self, connections: Iterable[tuple[str, str]]) -> Sources:
        """The same sources with other connections, as a list; places stay those of the files."""
        assert self.plant is not None
        data = {key: part for key, part in self.plant.data.items() if key != "adjacency"}
        data["connections"] = [f"{source} -> {target}" for source, target in connections]
        return replace(self, plant=replace(self.plant, data=data), adjacency=None)

    def names(self, kind: str) -> set[str]:
        """Names of all module types or fluids of the knowledge base, for messages."""
        documents = [d for k in (kind, "provider", "other") for d in self.by_kind.get(k, ())]
        return {str(d.data[kind]) for d in documents if kind in d.data}


def digest_of(documents: Iterable[Document | None], *more: str) -> str:
    """Hash of the content of documents, independent of layout and order."""
    texts = sorted(json.dumps(d.data, sort_keys=True) for d in documents if d is not None)
    return hashlib.sha256("\n".join([*texts, *more]).encode()).hexdigest()[:16]


def table_of(lists: Iterable[Document], found: list[Diagnostic]) -> UnitTable:
    """One table of several lists; a spelling in two of them must mean the same (KB030)."""
    merged: dict[str, dict[str, Any]] = {"units": {}, "quantities": {}}
    first: dict[tuple[str, str], Document] = {}
    for document in lists:
        for group, entries in merged.items():
            for name, part in document.data.get(group, {}).items():
                before = entries.setdefault(name, part)
                other = first.setdefault((group, name), document)
                if _meaning(before) != _meaning(part):
                    what = "unit" if group == "units" else "quantity"
                    message = f"the {what} '{name}' is described in two files, and not alike"
                    place, second = document.key(group, name), other.key(group, name)
                    found.append(Diagnostic(place, "KB030", message, "rename one", second))
    return unit_table(merged)


def _meaning(part: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in part.items() if key != "note"}
