"""`rulec show knowledge`: what came from which folder or package, with versions and hashes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.layers import Layer
from rulec.knowledge.read import read_all
from rulec.knowledge.sources import digest_of
from rulec.language.document import Document


def listing(plant: Path | None) -> Iterator[str]:
    """Lines of the listing; of a plant, or of what counts in the working folder.

    Raises `Refused` behind the last line with every mistake in what is listed, such as a name that
    stands in two layers (KB030).
    """
    sources = read_all(plant)
    for layer, documents in sources.by_layer().items():
        yield from _layer(layer, documents)
    check_knowledge(sources)


def _layer(layer: Layer, documents: list[tuple[str, Document]]) -> Iterator[str]:
    version = f" {layer.version}" if layer.version else ""
    digest = f", hash {digest_of(d for _, d in documents)}" if documents else ""
    yield f"{layer.name}{version} ({layer.kind}{digest}): {layer.folder}"
    rows = [row for kind, document in documents for row in _rows(layer, kind, document)]
    widths = [max((len(row[i]) for row in rows), default=0) for i in range(3)]
    for row in rows:
        columns = [text.ljust(width) for text, width in zip(row, widths, strict=False)]
        yield "  " + "  ".join([*columns, row[3]])
    yield ""


def _rows(layer: Layer, kind: str, document: Document) -> Iterator[tuple[str, str, str, str]]:
    """Kind, name, version and file of everything that a document describes."""
    file = layer.inside(document.path)
    if kind != "units":
        version = document.data.get("version")
        yield kind, str(document.data[kind]), "" if version is None else f"v{version}", file
        return
    for group, one in (("units", "unit"), ("quantities", "quantity")):
        for name in document.data.get(group, ()):
            yield one, name, "", file
