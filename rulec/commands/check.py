"""`rulec check`: all mistakes in knowledge and plant files, with place and remedy."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.terminal import styled

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.check_plant import check
from rulec.knowledge.read import read_files, read_plant
from rulec.language.diagnostics import Diagnostic, Refused, render_all
from rulec.language.document import Document
from rulec.passes.link import link
from rulec.passes.put_balances import dynamics_of

_LACKING = ("KB031", "KB047", "KB056", "KB065", "KB070")


def run(options: argparse.Namespace) -> int:
    """Check files and folders; exit code 1 if there is any mistake."""
    found = collect([Path(p) for p in options.paths])
    out = console(options)
    if found:
        out.print(render_all(found), soft_wrap=True)
        return 1
    out.print(styled("[green]✓[/] {}: no mistakes", ", ".join(options.paths)))
    return 0


def collect(paths: list[Path]) -> list[Diagnostic]:
    """All diagnostics of the given files, sorted by place."""
    sources, plants, found = read_files(paths)
    # A file that cannot be read may hold what others then seem to lack.
    muted = _LACKING if found else ()
    meaning = [d for part in sources for d in _refused_by(check_knowledge, part)]
    for plant in plants:
        meaning += _refused_by(_check_plant, plant)
    return sorted({*found, *(d for d in meaning if d.code not in muted)})


def _refused_by(step: Callable[..., object], *arguments: object) -> Sequence[Diagnostic]:
    """Mistakes for which a step refuses its arguments."""
    try:
        step(*arguments)
    except Refused as refused:
        return refused.diagnostics
    return ()


def _check_plant(document: Document) -> None:
    network = link(check(read_plant(Path(document.path))))
    if network.stores:
        dynamics_of(network, {name: [] for name in network.plant.modules})
