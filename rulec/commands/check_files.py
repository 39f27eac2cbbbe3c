"""Mistakes and doubts in files of knowledge and of plants, and in what belongs to them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.check_plant import check
from rulec.knowledge.doubts import doubts_of_plant, doubts_of_types
from rulec.knowledge.read import read_files, read_plant
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.language.document import Document
from rulec.passes.link import link
from rulec.passes.put_balances import dynamics_of

_LACKING = ("KB031", "KB047", "KB056", "KB065", "KB070")


def collect(paths: list[Path]) -> list[Diagnostic]:
    """All diagnostics of the given files, sorted by place; doubts only where nothing is wrong."""
    sources, plants, found = read_files(paths)
    # A file that cannot be read may hold what others then seem to lack.
    muted = _LACKING if found else ()
    meaning: list[Diagnostic] = []
    doubts: list[Diagnostic] = []
    for part in sources:
        meaning += _told_by(partial(_knowledge_doubts, part), doubts)
    for plant in plants:
        meaning += _told_by(partial(_plant_doubts, plant), doubts)
    mistakes = {*found, *(d for d in meaning if d.code not in muted)}
    return sorted(mistakes or {*doubts})


def _told_by(
    step: Callable[[], Iterable[Diagnostic]], doubts: list[Diagnostic]
) -> Sequence[Diagnostic]:
    """Mistakes for which a step refuses; else it adds its doubts."""
    try:
        doubts += step()
    except Refused as refused:
        return refused.diagnostics
    return ()


def _knowledge_doubts(sources: Sources) -> Iterable[Diagnostic]:
    knowledge = check_knowledge(sources)
    types = [document for document in sources.given if "module" in document.data]
    return doubts_of_types(types, knowledge)


def _plant_doubts(document: Document) -> Iterable[Diagnostic]:
    plant = check(read_plant(Path(document.path)))
    network = link(plant)
    if network.stores:
        dynamics_of(network, {name: [] for name in plant.modules})
    return doubts_of_plant(document, plant)
