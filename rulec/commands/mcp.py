"""`rulec mcp`: serve agents by the Model Context Protocol, on standard input and output.

Every tool reads files and answers; none writes. Files must lie in one folder, or in those that
`RULEC_FILES` names. The results are those of `import rulec`.
"""

from __future__ import annotations

import argparse
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rulec_runtime.output.open_file import FOLDERS, is_below, is_named
from rulec_runtime.output.refusal import Misused, Refusal, to_install
from rulec_runtime.recordings.formats import file_and_table

from rulec.commands.check import json_form as found_form
from rulec.commands.check_files import collect
from rulec.commands.diagnose import diagnose
from rulec.commands.matrix import json_form as matrix_form
from rulec.commands.mismatch import mismatch
from rulec.knowledge.read import read_all
from rulec.passes.compile_cache import ruleset_of_plant

ABOUT = """\
Fault diagnosis of modular hydraulic plants. A plant is a folder with a plant.yaml, a recording a
file or folder of readings (CSV, Excel, Parquet and others), both as seen from the served folder.
Begin with knowledge and check; matrix tells what could be found at all; diagnose and explain judge
a recording for faults; mismatch tells what physics the model of a plant leaves out, which may take
minutes."""


def run(options: argparse.Namespace) -> int:
    """Serve until standard input ends."""
    server(Path(options.folder)).run("stdio")
    return 0


def server(folder: Path) -> Any:
    """A server of the official SDK, whose tools read files of a folder.

    Raises `Refusal` if the SDK is not installed, `Misused` if there is no such folder.
    """
    try:
        from mcp.server import MCPServer
        from mcp.server.mcpserver.exceptions import ToolError
        from mcp.types import ToolAnnotations
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "mcp":
            raise
        raise Refusal(
            f"to serve agents, install what it needs: {to_install('mcp', 'rulec')}"
        ) from None
    if not folder.is_dir():
        raise Misused(f"{folder}: there is no such folder to serve")
    made = MCPServer("rulec", instructions=ABOUT, log_level="ERROR")
    desk = Desk(folder.resolve())
    for tool in (
        desk.knowledge, desk.check, desk.matrix, desk.diagnose, desk.explain, desk.mismatch
    ):  # fmt: skip
        made.add_tool(
            _with_refusals(tool, ToolError),
            annotations=ToolAnnotations(read_only_hint=True, open_world_hint=False),
        )
    return made


def _with_refusals(tool: Callable[..., Any], error: type[Exception]) -> Callable[..., Any]:
    """A tool whose refusals reach the agent. Any other exception is a bug, and stays hidden."""

    @functools.wraps(tool)
    def called(*given: Any, **named: Any) -> Any:
        try:
            return tool(*given, **named)
        except (Refusal, Misused) as refused:
            raise error(str(refused)) from None
        except OSError as refused:
            raise error(f"{refused.filename}: {refused.strerror}") from None

    return called


class Desk:
    """What agents can ask about the files of a folder. They read the docstrings of its methods."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def _path(self, text: str) -> Path:
        """A path that may be read; ``#`` may precede the name of a table in the file."""
        path = self._folder / text
        place = file_and_table(path)[0]
        if not (is_below(place, self._folder) or is_named(place)):
            raise Refusal(f"'{text[:80]}' leads out of the served folder; {FOLDERS} names others")
        if not place.exists():
            raise Refusal(f"'{text[:80]}': there is no such file or folder in the served one")
        return path

    def knowledge(self, plant: str | None = None, name: str | None = None) -> dict[str, Any]:
        """List what is known of equipment: module types, faults, effects, sensors, fluids, units.

        With `plant` what counts for that plant. With `name` the whole description of one entry,
        with its equations, parameters, uncertainties and sources.
        """
        sources = read_all(None if plant is None else self._path(plant))
        kinds = {kind: docs for kind, docs in sources.by_kind.items() if kind != "units"}
        if name is None:
            return {
                kind: {str(d.data[kind]): d.data.get("title", "") for d in documents}
                for kind, documents in kinds.items()
            }
        found = [
            {"kind": kind, "file": d.label, **d.data}
            for kind, documents in kinds.items()
            for d in documents
            if str(d.data.get(kind)) == name
        ]
        if not found:
            raise Refusal(f"nothing is called '{name[:80]}'; knowledge without a name lists all")
        return found[0]

    def check(self, path: str) -> dict[str, Any]:
        """Validate a YAML file or folder: every mistake and doubt with place, reason and remedy."""
        return {"found": found_form(collect([self._path(path)]))}

    def matrix(self, plant: str) -> dict[str, Any]:
        """Which fault moves which residual, how far; which faults cannot be told apart, and which
        further sensor would help."""
        return matrix_form(ruleset_of_plant(self._path(plant)))

    def diagnose(self, plant: str, recording: str) -> dict[str, Any]:
        """Judge a recording: which fault, how large, since when, how sure, alternatives, and what
        to look at. `status` is ok, or a code of NAMUR NE 107 such as M or C."""
        return diagnose(self._path(plant), self._path(recording)).to_dict()

    def explain(self, plant: str, recording: str) -> str:
        """Tell the same as an engineer reads it: findings with their evidence, estimate against
        estimate, what speaks against alternatives, and what remains open."""
        return str(diagnose(self._path(plant), self._path(recording)))

    def mismatch(self, plant: str, recordings: list[str]) -> dict[str, Any]:
        """Tell where simulation and recordings of a plant differ, which physics its model leaves
        out, with probability and proof on data that were held out. May take minutes."""
        given = [self._path(recording) for recording in recordings]
        found = mismatch(self._path(plant), given)
        return {**found.to_dict(), "story": str(found)}
