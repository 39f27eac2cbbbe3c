"""Units and sensor classes of a knowledge base; the rest of it is not read."""

from __future__ import annotations

import re
from pathlib import Path

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.read import Sources, yaml_files_in
from rulec.language.diagnostics import Refused
from rulec.language.document import Document, read_document

_SENSOR = re.compile(rb"^sensor:", re.MULTILINE)
_HEAD = 4096
"""Bytes at the beginning of a file in which its first key stands."""


def read_units_and_sensors(kb: Path) -> Knowledge:
    """Knowledge without modules, faults and effects. Raises `Refused` for mistakes in its files."""
    sensors = [file for file in yaml_files_in(kb) if _SENSOR.search(_head(file))]
    units, *classes = [_document(file) for file in (kb / "units.yaml", *sensors)]
    return check_knowledge(Sources(kb=kb, units=units, by_kind={"sensor": tuple(classes)}))


def _head(file: Path) -> bytes:
    with file.open("rb") as stream:
        return stream.read(_HEAD)


def _document(file: Path) -> Document:
    document, mistakes = read_document(file)
    if document is None:
        raise Refused(mistakes)
    return document
