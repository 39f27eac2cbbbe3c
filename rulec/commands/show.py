"""`rulec show`: the result of a compiler pass in readable form, or what is known from where."""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.output.refusal import Misused

from rulec.passes.compile_cache import saved_of_plant

if TYPE_CHECKING:
    from rulec.knowledge.layers import Layer
    from rulec.language.read_yaml import Document

KNOWLEDGE = "knowledge"


def run(options: argparse.Namespace) -> int:
    """Run the passes up to the named one and print its result."""
    plant = None if options.plant is None else Path(options.plant)
    out = console(options)
    for line in _lines(options.step, plant):
        out.print(line, soft_wrap=True)
    return 0


def _lines(step: str, plant: Path | None) -> Iterable[str]:
    """Lines to print; those about a plant are cached."""
    if step == KNOWLEDGE:
        return listing(plant)
    if plant is None or not step.isidentifier():
        return _printer(step, plant)()
    # Lines name places of files relative to the working folder.
    here = hashlib.sha256(str(Path.cwd()).encode("utf-8", "surrogateescape")).hexdigest()[:12]
    lines: Iterable[str] = saved_of_plant(
        plant, f"shown-{step}-{here}", lambda: list(_printer(step, plant)())
    )
    return lines


def _printer(asked: str, plant: Path | None) -> Callable[[], Iterable[str]]:
    """What gives the lines of a step, by its name or a word of it; raises `Misused` for others."""
    from rulec.commands.show_steps import STEPS, lines_of  # loads the compiler

    short = [name for name in STEPS if asked in name.split("_")]
    step = short[0] if len(short) == 1 else asked
    if step == "passes":
        return lambda: (
            "passes in order: " + ", ".join(STEPS),
            f"also: {KNOWLEDGE}, all known equipment and where it is defined",
        )
    if step not in STEPS:
        hint = did_you_mean(step, [*STEPS, KNOWLEDGE])
        raise Misused(f"there is no pass '{step}'; {hint}; 'rulec show passes' lists all of them")
    if plant is None:
        raise Misused(f"which plant? give rulec show {step} PLANT")
    return lambda: lines_of(step, plant)


def listing(plant: Path | None) -> Iterator[str]:
    """Lines of the listing for a plant, or for the working folder.

    After the last line, raises `Refused` with every mistake in what is listed, such as a name in
    two layers (KB030).
    """
    from rulec.knowledge.check_knowledge import check_knowledge  # reads YAML, as do these
    from rulec.knowledge.read import read_all
    from rulec.knowledge.sources import digest_of

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
