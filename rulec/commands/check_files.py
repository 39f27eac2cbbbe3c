"""Mistakes and doubts in knowledge files and plant files."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from rulec.algebra.continuity import FlowGraph, flows_by_continuity
from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.doubts import (
    doubts_of_balances,
    doubts_of_columns,
    doubts_of_plant,
    doubts_of_redundancy,
    doubts_of_types,
)
from rulec.knowledge.read import read_all, read_files
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.language.read_yaml import Document
from rulec.passes.derive_residuals import Residual
from rulec.passes.link import observed_through_states
from rulec.passes.pipeline import run_passes
from rulec.passes.put_balances import dynamics_of
from rulec.passes.types import Compilation


def collect(paths: list[Path]) -> list[Diagnostic]:
    """All diagnostics of the given files, sorted by place; doubts only if there is no mistake."""
    sources, plants, found = read_files(paths)
    # Others may seem to lack what an unreadable file holds.
    muted = ("KB031", "KB047", "KB056", "KB065", "KB070") if found else ()
    meaning: list[Diagnostic] = []
    doubts: list[Diagnostic] = []
    for part in sources:
        meaning += _mistakes(partial(_knowledge_doubts, part), doubts)
    for plant in plants:
        meaning += _mistakes(partial(_plant_doubts, plant), doubts)
    mistakes = {*found, *(d for d in meaning if d.code not in muted)}
    return sorted(mistakes or {*doubts})


def _mistakes(
    step: Callable[[], Iterable[Diagnostic]], doubts: list[Diagnostic]
) -> Sequence[Diagnostic]:
    """The mistakes for which a step refuses; without any, the step adds its doubts."""
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
    """Doubts about a plant, and what only the later passes of the compiler refuse."""
    models = run_passes(Compilation(path=Path(document.path)), "residuals")
    plant, network, residuals = models.plant, models.network, models.residuals
    if network.stores:
        dynamics_of(network, {name: [] for name in plant.modules})
    apart = [(r.module, r.terms) for r in residuals if len({*_modules_of(r)}) > 1]
    doubts = [*doubts_of_plant(document, plant), *doubts_of_balances(document, plant, apart)]
    doubts += doubts_of_columns(document, plant, partial(_same_flow, network.graph))
    used = {name for r in residuals for name in _modules_of(r)}
    used |= observed_through_states(network) if network.stores else set()
    # Modules with faults whose estimates occur in no residual and move nothing that is stored.
    modules = network.plant.modules.values()
    unused = [m for m in modules if m.type.observers and m.type.faults and m.name not in used]
    if unused:
        types = check_knowledge(read_all(Path(document.path))).modules.values()
        doubts += doubts_of_redundancy(document, plant, [m.name for m in unused], types)
    try:
        run_passes(models, "signatures")
    except Refused as refused:
        doubts += refused.diagnostics  # the doubts may explain them
    return doubts


def _same_flow(graph: FlowGraph, module: str) -> Iterable[str]:
    """Modules whose flow is that of `module` by continuity."""
    known = flows_by_continuity(graph, [module]).items()
    return [name for name, flow in known if flow.terms == {module: 1}]


def _modules_of(residual: Residual) -> list[str]:
    """The module of each term."""
    return [observer.split(".")[0] for _, observer in residual.terms]
