"""`rulec check`: all mistakes in knowledge and plant files, with place and remedy."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rulec_runtime.commands.destinations import console, write_json
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.formats import is_called_recording
from rulec_runtime.recordings.given import STANDARD_INPUT, place_of

from rulec.commands.check_formats import json_form, sarif_form
from rulec.commands.recording_facts import Facts, facts_of
from rulec.commands.recording_story import json_form as recording_form
from rulec.commands.recording_story import tell
from rulec.effects.model_builder import open_builder
from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.check_plant import check
from rulec.knowledge.doubts import doubts_of_plant, doubts_of_types
from rulec.knowledge.layers import version_of_rulec, yaml_files_in
from rulec.knowledge.read import read_files, read_plant
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Diagnostic, Refused, render_all
from rulec.language.document import Document
from rulec.passes.link import link
from rulec.passes.put_balances import dynamics_of

_LACKING = ("KB031", "KB047", "KB056", "KB065", "KB070")


def run(options: argparse.Namespace) -> int:
    """Check files and folders, and a recording of the plant among them.

    Exit code 1 if there is any mistake, or if nothing in the recording can be judged.
    """
    recordings = [path for path in map(Path, options.paths) if is_recording(path)]
    paths = [path for path in map(Path, options.paths) if path not in recordings]
    if recordings and len(paths) != 1:
        raise Misused("a recording is checked with its plant, as PLANT RECORDING")
    found = collect(paths)
    wrong = any(not one.doubt for one in found)
    facts: dict[str, Facts] = {}
    if recordings and not wrong:
        ruleset, builder = open_builder(paths[0])
        facts = {str(path): facts_of(path, ruleset, builder.matches) for path in recordings}
    options.json = None if options.format == "text" else "-"
    if options.json is None:
        _tell(console(options), options.paths if not facts else paths, found, facts)
    elif options.format == "sarif":
        write_json(options, sarif_form(found, version_of_rulec()))
    else:
        told = {name: recording_form(part) for name, part in facts.items()}
        write_json(options, {"found": json_form(found), "recordings": told})
    return 1 if wrong or not all(part.judges_something for part in facts.values()) else 0


def is_recording(path: Path) -> bool:
    """Is it none of the files that are checked, or a folder with recordings and without YAML?"""
    place = place_of(path)[0]
    if place.is_dir():
        return any(is_called_recording(f) for f in place.iterdir()) and not yaml_files_in(place)
    return place == STANDARD_INPUT or (place.is_file() and place.suffix not in (".yaml", ".yml"))


def _tell(
    out: Console, paths: Sequence[object], found: Sequence[Diagnostic], facts: Mapping[str, Facts]
) -> None:
    if found:
        out.print(render_all(found), soft_wrap=True)
    if all(one.doubt for one in found):
        out.print(styled("[green]✓[/] {}: no mistakes", ", ".join(map(str, paths))))
    for name, part in facts.items():
        tell(out, name, part)


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
