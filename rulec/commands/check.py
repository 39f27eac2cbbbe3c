"""`rulec check`: all mistakes in knowledge files and plant files, with place and remedy."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from rich.console import Console
from rulec_runtime.commands.destinations import console, note_aside, write_json, write_to
from rulec_runtime.output.plural import plural
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.formats import STANDARD_INPUT, file_and_table, is_called_recording

from rulec.knowledge.layers import version_of_rulec, yaml_files_in
from rulec.language.diagnostics import Diagnostic, Place, Refused, render_all
from rulec.passes.compile_cache import ruleset_of_plant, saved_of_plant

if TYPE_CHECKING:
    from rulec.commands.recording_facts import Facts


def run(options: argparse.Namespace) -> int:
    """Check files and folders, and any recordings of the plant among them.

    The exit code is 1 if there is a mistake, or if nothing in a recording can be judged.
    """
    recordings = [path for path in map(Path, options.paths) if is_recording(path)]
    paths = [path for path in map(Path, options.paths) if path not in recordings]
    if recordings and len(paths) != 1:
        raise Misused("a recording is checked with its plant, as PLANT RECORDING")
    if options.write_map is not None:
        if len(recordings) != 1:
            raise Misused("--write-map needs one recording, as in PLANT RECORDING --write-map")
        return _write_map(options, paths[0], recordings[0])
    if recordings:
        found, facts = _facts(paths[0], recordings)
    else:
        found, facts = _collected(paths), {}
    wrong = any(not one.doubt for one in found)
    options.json = None if options.format == "text" else "-"
    if options.json is None:
        _tell(console(options), options.paths if not facts else paths, found, facts)
    elif options.format == "sarif":
        write_json(options, sarif_form(found, version_of_rulec()))
    else:
        write_json(options, {"found": json_form(found), "recordings": facts})
    return 1 if wrong or not all(part["faults"][0] for part in facts.values()) else 0


def _write_map(options: argparse.Namespace, plant: Path, recording: Path) -> int:
    """Propose a column map; the exit code is 1 if the user must answer a question first."""
    from rulec.commands.column_map import proposed
    from rulec.knowledge.read import read_plant
    from rulec.passes.pipeline import run_passes  # loads the compiler
    from rulec.passes.types import Compilation

    sources = read_plant(plant, new_map=True)
    ruleset = run_passes(Compilation(sources=sources)).ruleset
    map_ = proposed(recording, ruleset, sources.columns.data if sources.columns else {})
    write_to(options.write_map, map_.text)
    for one in map_.assumed:
        note_aside(options, f"assumed: {one}")
    for one in map_.asked:
        note_aside(options, f"to be answered in the map: {one}")
    if options.write_map != "-":
        note_aside(
            options,
            f"wrote {options.write_map}; look at it, and name it in plant.yaml as "
            f"'columns: {Path(options.write_map).name}'",
        )
    return 1 if map_.asked else 0


def is_recording(path: Path) -> bool:
    """Whether a path is a recording: a file other than YAML, or a folder of recordings alone."""
    place = file_and_table(path)[0]
    if place.is_dir():
        return any(is_called_recording(f) for f in place.iterdir()) and not yaml_files_in(place)
    return place == STANDARD_INPUT or (place.is_file() and place.suffix not in (".yaml", ".yml"))


def _tell(
    out: Console, paths: Sequence[object], found: Sequence[Diagnostic], facts: Mapping[str, Facts]
) -> None:
    if found:
        out.print(render_all(found), soft_wrap=True)
    if all(one.doubt for one in found):
        warned = f", {plural(len(found), 'warning', 'warnings')}" if found else ""
        shown = ", ".join(map(str, paths))
        out.print(styled("[green]✓[/] {}: no mistakes{}", shown, warned))
    if facts:
        from rulec.commands.recording_facts import tell

        for name, part in facts.items():
            tell(out, name, part)


def _collected(paths: Sequence[Path]) -> list[Diagnostic]:
    from rulec.commands.check_files import collect  # loads the compiler

    return collect(list(paths))


def _facts(plant: Path, recordings: Sequence[Path]) -> tuple[list[Diagnostic], Mapping[str, Facts]]:
    """What recordings are good for, with doubts about the plant; or only the mistakes in it."""
    from rulec.commands.recording_facts import facts_of, sought_in

    try:
        sought, ruleset = sought_in(plant), ruleset_of_plant(plant)
    except Refused as refused:
        return _collected([plant]) or list(refused.diagnostics), {}
    facts = {str(path): facts_of(path, ruleset, sought) for path in recordings}
    # Doubts name files as seen from the working folder, so only their number is kept.
    doubtful = saved_of_plant(plant, "doubts", lambda: len(_collected([plant])))
    return _collected([plant]) if doubtful else [], facts


SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def json_form(found: Sequence[Diagnostic]) -> list[dict[str, Any]]:
    """Each diagnostic with its place; lines and columns count from 1."""
    return [
        {
            "code": one.code,
            "kind": "doubt" if one.doubt else "mistake",
            "message": one.message,
            "hint": one.hint,
            **asdict(one.place),
            "see_also": None if one.second is None else asdict(one.second),
        }
        for one in found
    ]


def sarif_form(found: Sequence[Diagnostic], version: str) -> dict[str, Any]:
    """A log with one run. Mistakes are errors, doubts are warnings."""
    driver = {
        "name": "rulec",
        "version": version or "0",
        "rules": [{"id": code} for code in sorted({one.code for one in found})],
    }
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "results": [_result(one) for one in found],
    }
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


def _result(one: Diagnostic) -> dict[str, Any]:
    text = f"{one.message} ({one.hint})" if one.hint else one.message
    result = {
        "ruleId": one.code,
        "level": "warning" if one.doubt else "error",
        "message": {"text": text},
        "locations": [_location(one.place)],
    }
    if one.second is not None:
        result["relatedLocations"] = [_location(one.second)]
    return result


def _location(place: Place) -> dict[str, Any]:
    region = {
        "startLine": place.line,
        "startColumn": place.column,
        "endColumn": place.column + place.length,
    }
    return {"physicalLocation": {"artifactLocation": {"uri": quote(place.file)}, "region": region}}
