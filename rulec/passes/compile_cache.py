"""Results kept from an earlier start, valid while no source of the plant has changed.

Nothing here imports a pass at its top, as a compiler that need not run need not be loaded.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import RulesetRefused, parse_ruleset
from rulec_runtime.output.json_file import Damaged, parse_json
from rulec_runtime.output.private_folder import keep, kept

from rulec.knowledge.fingerprint import named_in, print_of_all, print_of_text
from rulec.knowledge.layers import plant_file
from rulec.language.diagnostics import Refused


def ruleset_of_plant(
    plant: Path, make: Callable[[], Ruleset] | None = None, now: str | None = None
) -> Ruleset:
    """The ruleset of a plant (folder or file), compiled only if something has changed.

    `make` replaces the compiler if the caller has compiled the plant anyway; `now` is its
    `known_print`, if known. Raises `Refused` with all mistakes of the first bad pass.
    """
    known = _text(now or known_print(plant), "ruleset")
    if known is not None:
        try:
            return parse_ruleset(parse_json(known))
        except (Damaged, RulesetRefused):  # written by another version; compile it again
            pass
    before = _print(plant)
    if make is None:
        from rulec.passes.pipeline import compile_plant

        ruleset = compile_plant(plant)
    else:
        ruleset = make()
    _keep(plant, "ruleset", before, ruleset.to_json())
    return ruleset


def kept_of_plant(
    plant: Path, kind: str, make: Callable[[], Any], whole: bool = False, now: str | None = None
) -> Any:
    """JSON data that depend only on a plant: those of an earlier start, else made by `make`.

    None is never kept. `whole`: they depend on all YAML files in its folder. `now` is as in
    `ruleset_of_plant`.
    """
    known = _text(now or known_print(plant, whole), kind)
    if known is not None:
        try:
            return parse_json(known)
        except Damaged:
            pass
    before = _print(plant, whole)
    made = make()
    if made is not None:
        _keep(plant, kind, before, json.dumps(made), whole)
    return made


def known_print(plant: Path, whole: bool = False) -> str | None:
    """Hash of all sources of a plant; None if its file has changed since it was last read."""
    file = plant_file(plant)
    try:
        names = kept(f"{print_of_text(file)}.names")
        return None if names is None else print_of_all(file, json.loads(names), whole)
    except (OSError, ValueError, Refused):
        return None


def _text(now: str | None, kind: str) -> str | None:
    """The text kept for sources with this hash."""
    found = None if now is None else kept(f"{now}.{kind}")
    try:
        return None if found is None else found.decode("utf-8")
    except ValueError:
        return None


def _print(plant: Path, whole: bool = False) -> tuple[str, dict[str, list[str]]] | None:
    """Hash of all sources of a plant, and the files that it names; None if it has mistakes."""
    from rulec.language.document import read_document

    file = plant_file(plant)
    try:
        document, _ = read_document(file)
        if document is None or not isinstance(document.data, dict):
            return None
        names = named_in(document.data)
        return print_of_all(file, names, whole), names
    except (OSError, ValueError, Refused):
        return None


def _keep(
    plant: Path,
    kind: str,
    before: tuple[str, dict[str, list[str]]] | None,
    text: str,
    whole: bool = False,
) -> None:
    """Keep a result, unless a source has changed meanwhile: either version may have been read."""
    if before is None or before != _print(plant, whole):
        return
    found, names = before
    keep(f"{print_of_text(plant_file(plant))}.names", json.dumps(names).encode())
    keep(f"{found}.{kind}", text.encode("utf-8"))
