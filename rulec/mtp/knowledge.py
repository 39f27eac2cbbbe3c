"""Read units and sensor classes of the layers of knowledge, and nothing else of them."""

from __future__ import annotations

import re
from collections.abc import Iterable

from rulec_runtime.output.open_file import begin_of

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.layers import Layer
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Refused
from rulec.language.document import read_document
from rulec.language.schema import kind_of

_KINDS = re.compile(rb"^(sensor|units):", re.MULTILINE)
_HEAD = 4096
"""Bytes at the beginning of a file that hold its first key."""


def read_units_and_sensors(layers: Iterable[Layer]) -> Knowledge:
    """Knowledge without modules, faults and effects. Raises `Refused` for mistakes in its files."""
    stack = tuple(layers)
    files = dict.fromkeys(file for layer in reversed(stack) for file in layer.files)
    documents = []
    for file in files:
        if _KINDS.search(begin_of(file, _HEAD)):
            document, mistakes = read_document(file)
            if document is None:
                raise Refused(mistakes)
            documents.append(document)
    by_kind = {
        kind: tuple(document for document in documents if kind_of(document) == kind)
        for kind in ("sensor", "units")
    }
    return check_knowledge(Sources(layers=stack, by_kind=by_kind))
