"""Mistakes and doubts in files of knowledge and of plants, and in what belongs to them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.check_plant import check
from rulec.knowledge.doubts import doubts_of_plant, doubts_of_redundancy, doubts_of_types
from rulec.knowledge.read import read_all, read_files, read_plant
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.language.document import Document
from rulec.passes.derive_residuals import derive_residuals
from rulec.passes.link import Network, link
from rulec.passes.observed_modules import seen_through_states
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
    doubts = [*doubts_of_plant(document, plant)]
    if unchecked := _unchecked(network):
        types = check_knowledge(read_all(Path(document.path))).modules.values()
        doubts += doubts_of_redundancy(document, plant, unchecked, types)
    return doubts


def _unchecked(network: Network) -> list[str]:
    """Modules with faults and an estimate that stands in no residual and moves no stored thing."""
    used = {o.split(".")[0] for r in derive_residuals(network) for _, o in r.terms}
    used |= seen_through_states(network) if network.stores else set()
    modules = network.plant.modules.values()
    return [m.name for m in modules if m.type.observers and m.type.faults and m.name not in used]
