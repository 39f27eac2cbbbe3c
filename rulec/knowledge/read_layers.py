"""Documents of all layers of knowledge, by kind."""

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from rulec_runtime.output.nearest import nearest
from rulec_runtime.output.open_file import is_near

from rulec.knowledge.layers import OWN, PACKAGE, Layer, has_line, leads_out, shipped
from rulec.knowledge.sources import LayerDocuments
from rulec.knowledge.tables import with_tables
from rulec.language.diagnostics import KINDS, Diagnostic, Place, no_file_of_ours
from rulec.language.read_yaml import Document, read_document
from rulec.language.schema import check_schema, kind_of

KNOWLEDGE = ("module", "fault", "effect", "sensor", "fluid")

_EFFECT = re.compile(rb"^effect:", re.MULTILINE)
"""A file that is skipped if no effects are wanted: parsing all of them takes longer than compiling
a small plant."""

_WORD = re.compile(r"[A-Za-z%][A-Za-z0-9_-]*")
_PROSE = frozenset(("title", "text", "source", "note", "action", "meaning"))


def read_layers(
    layers: Iterable[Layer],
    wanted: Mapping[str, set[str]] | None = None,
    given: Iterable[Path] = (),
    effects: bool = True,
) -> list[LayerDocuments]:
    """The content of each layer.

    Parameters
    ----------
    wanted : names of the module types and fluids that a plant has; None: all. The kind ``provider``
        holds other module types whose provided names a plant may use; ``other`` holds the rest,
        unchecked, for their names.
    given : files that have been read already and are left out.
    effects : whether effects are read.
    """
    done = {os.path.realpath(file) for file in given}
    result = []
    for layer in layers:
        content = LayerDocuments(layer)
        for file in layer.files:
            real = os.path.realpath(file)
            if real not in done and (effects or not has_line(file, _EFFECT)):
                _add(content, file, wanted)
            done.add(real)
        result.append(content)
    return result


def in_use(contents: Iterable[LayerDocuments], naming: Iterable[Document]) -> list[LayerDocuments]:
    """Layers that apply to a plant: all but the installed packages it does not use.

    A package applies if the plant (its documents are `naming`), or a layer that applies, uses one
    of its names, so that installing a package does not change other plants. A package with effects
    applies wherever effects are read.
    """
    parts = list(contents)
    taken = [p for p in parts if p.layer.kind != PACKAGE or p.by_kind.get("effect")]
    waiting = [p for p in parts if p not in taken]
    if not waiting:
        return parts
    words = {word for document in naming for word in _words(document.data)}
    for part in taken:
        words |= _words_of(part)
    while more := [p for p in waiting if not words.isdisjoint(p.ids())]:
        waiting = [p for p in waiting if p not in more]
        for part in more:
            words |= _words_of(part)
    return [p for p in parts if p not in waiting]


def _words_of(content: LayerDocuments) -> set[str]:
    """Names used in its files; in shared layers, only in the modules and fluids of the plant."""
    kinds = content.by_kind.keys() if content.layer.is_own else ("module", "fluid")
    documents = (d for kind in kinds for d in content.by_kind.get(kind, ()) if kind != "other")
    return {word for document in documents for word in _words(document.data)}


def _words(data: Any) -> Iterator[str]:
    if isinstance(data, Mapping):
        for key, part in data.items():
            if key not in _PROSE:
                yield from _words(part)
    elif isinstance(data, list):
        for part in data:
            yield from _words(part)
    elif isinstance(data, str):
        yield data
        yield from _WORD.findall(data)


def _add(content: LayerDocuments, file: Path, wanted: Mapping[str, set[str]] | None) -> None:
    beside = content.layer.folder.parent if content.layer.kind == OWN else content.layer.folder
    if content.layer.is_own and not is_near(file, beside):
        content.mistakes.append(leads_out(Place(file.as_posix())))
        return
    document = open_document(file, None, content.mistakes)
    if document is None:
        return
    if not content.layer.is_whole:
        inside = file.relative_to(content.layer.folder).as_posix()
        document = replace(document, label=f"{content.layer.name}/{inside}")
    kind = kind_of(document) or ""
    mistakes = content.mistakes
    if wanted is not None and kind in wanted and str(document.data[kind]) not in wanted[kind]:
        kind, mistakes = "provider", []
    if kind == "provider" and "provides" not in document.data:
        content.by_kind.setdefault("other", []).append(document)
    elif conforms(document, mistakes):
        content.by_kind.setdefault(kind, []).append(with_tables(document, mistakes))


def open_document(
    file: Path, kind: str | None, found: list[Diagnostic], named_at: Place | None = None
) -> Document | None:
    """Read one file of the given kind, or of any; `named_at` is the place that names it."""
    document, mistakes = read_document(file)
    found.extend(mistakes)
    if document is None:
        return None
    actual = kind_of(document)
    if actual is not None and kind in (None, actual):
        return document
    first = list(document.data)[:1] if isinstance(document.data, dict) else []
    near = nearest(first[0], KINDS) if first else None
    place = document.key(*first)
    if actual is None:
        found.append(no_file_of_ours(place, near if near not in first else None, named_at))
        return None
    message, hint = f"this is not a {kind} file", f"its first key should be '{kind}'"
    found.append(Diagnostic(place, "KB012", message, hint, named_at))
    return None


def conforms(document: Document, found: list[Diagnostic]) -> bool:
    """Whether a document conforms to the schema of its kind; mistakes are added to `found`."""
    mistakes = check_schema(document, kind_of(document) or "", shipped("kb") / "schema")
    found.extend(mistakes)
    return not mistakes
