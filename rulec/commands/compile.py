"""`rulec compile`: from the files of a plant to its ruleset."""

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from rich.console import Console
from rulec_runtime.commands.destinations import console, progress_of, write_to
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text

from rulec.commands.result import AnyPath, Columns, Result, parts_of


@dataclass(frozen=True, kw_only=True)
class CompileResult(Result):
    """A compiled plant; the other functions take it in place of a path.

    Attributes
    ----------
    path : of the plant, as given.
    ruleset : everything that a diagnosis needs; SI.

    Tables: `rules` (how each fault moves each residual) and `faults`.
    """

    path: Path
    ruleset: Ruleset

    def __repr__(self) -> str:
        return f"<CompileResult {self.ruleset.plant}: {self.counts}>"

    @property
    def counts(self) -> str:
        """The numbers of modules, residuals, faults and rules, in words."""
        rules = self.ruleset
        parts = {"module": rules.modules, "residual": rules.residuals, "fault": rules.faults}
        parts["rule"] = rules.cells
        return ", ".join(plural(len(part), name, f"{name}s") for name, part in parts.items())

    def to_dict(self) -> dict[str, Any]:
        """The ruleset as its file holds it."""
        return dict(json.loads(self.ruleset.to_json()))

    def write(self, file: AnyPath) -> None:
        """Write the ruleset file, for `rulec-runtime` and for all functions that take a plant."""
        write_text(Path(file), self.ruleset.to_json())

    def tell(self, out: Console, name: str | None = None) -> None:
        """Print what was compiled, under a `name` such as that of its file."""
        out.print(styled("[green]✓[/] {}: {}", name or self.ruleset.plant, self.counts))
        doubt = "[yellow]![/] {} leaves no trace in any residual; it needs a further sensor"
        for fault in self.ruleset.unobserved:
            out.print(styled(doubt, fault))

    def _rules(self) -> Columns:
        return parts_of(("fault", "residual", "sign", "gain", "detectable"), self.ruleset.cells)

    def _faults(self) -> Columns:
        faults = self.ruleset.faults
        names = ("module", "status", "title", "action")
        return {"fault": [f.id for f in faults], **parts_of(names, faults)}

    _tables: ClassVar = {"rules": _rules, "faults": _faults}


def compile(plant: AnyPath) -> CompileResult:
    """Derive the ruleset of a plant.

    Parameters
    ----------
    plant : folder with a plant.yaml, or that file.

    Raises
    ------
    Refused
        Files have mistakes. The message shows each with its place and remedy; `diagnostics` holds
        them.

    Examples
    --------
    >>> import rulec
    >>> print(rulec.compile("plants/abc"))
    ✓ abc: 3 modules, 9 residuals, 18 faults, 76 rules
    """
    from rulec.passes.compile_cache import ruleset_of_plant

    path = Path(plant)
    return CompileResult(path=path, ruleset=ruleset_of_plant(path))


def run(options: argparse.Namespace) -> int:
    """Compile a plant to a ruleset file."""
    with progress_of(options, "compiling the plant"):
        found = compile(options.plant)
    target = options.output or f"{found.ruleset.plant}.ruleset.json"
    write_to(target, found.ruleset.to_json())
    found.tell(console(options), target)
    return 0
