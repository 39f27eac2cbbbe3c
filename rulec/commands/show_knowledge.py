"""`rulec show knowledge`: what comes from which folder or package, with versions and hashes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.layers import Layer
from rulec.knowledge.read import read_all
from rulec.knowledge.sources import digest_of
from rulec.language.document import Document


def listing(plant: Path | None) -> Iterator[str]:
    """Lines of the listing for a plant, or for the working folder.

    After the last line, raises `Refused` with every mistake in what is listed, such as a name in
    two layers (KB030).
    """
    sources = read_all(plant)
    for layer, documents in sources.by_layer().items():
        version = f" {layer.version}" if layer.version else ""
        digest = f", hash {digest_of(d for _, d in documents)}" if documents else ""
        yield f"{layer.name}{version} ({layer.kind}{digest}): {layer.folder}"
        rows = [row for kind, document in documents for row in _rows(layer, kind, document)]
        widths = [max((len(row[i]) for row in rows), default=0) for i in range(3)]
        for row in rows:
            columns = [text.ljust(width) for text, width in zip(row, widths, strict=False)]
            yield "  " + "  ".join([*columns, row[3]])
        yield ""
    check_knowledge(sources)


def _rows(layer: Layer, kind: str, document: Document) -> Iterator[tuple[str, str, str, str]]:
    """Kind, name, version and file of each thing that a document describes."""
    file = layer.inside(document.path)
    if kind != "units":
        version = document.data.get("version")
        yield kind, str(document.data[kind]), "" if version is None else f"v{version}", file
        return
    for group, one in (("units", "unit"), ("quantities", "quantity")):
        for name in document.data.get(group, ()):
            yield one, name, "", file
