"""`rulec diagnose`: judge a recording with a ruleset, or with a plant compiled on the way."""

from __future__ import annotations

import argparse
from pathlib import Path

from rulec_runtime.commands.diagnose import run as judge
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis


def run(options: argparse.Namespace) -> int:
    """Diagnose a recording; findings are a result, so the exit code is 0 either way."""
    limits = None if options.limits is None else Path(options.limits)
    return judge(options, load, lambda diagnosis: with_steps(diagnosis, limits))


def with_steps(diagnosis: Diagnosis, limits: Path | None) -> Diagnosis:
    """A diagnosis with a step for each finding that may be something else; what it takes is loaded
    only then."""
    if limits is None and not any(f.alternatives for f in diagnosis.findings):
        return diagnosis
    from rulec.separation.allowed import allowed_of
    from rulec.separation.steps import add_steps

    given = None
    if limits is not None:
        from rulec.separation.limits_file import read_limits

        given = read_limits(limits, diagnosis.ruleset)
    return add_steps(diagnosis, allowed_of(diagnosis.ruleset, given))


def load(path: Path) -> Ruleset:
    """Read a ruleset file, or compile a plant (which alone needs the compiler)."""
    if path.suffix == ".json":
        return read_ruleset(path)
    from rulec.passes.pipeline import compile_plant

    return compile_plant(path)
