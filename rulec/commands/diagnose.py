"""`rulec diagnose`: judge a recording with a ruleset, or with a plant compiled on the way."""

from __future__ import annotations

import argparse
from pathlib import Path

from rulec_runtime.commands.diagnose import run as judge
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset


def run(options: argparse.Namespace) -> int:
    """Diagnose a recording; findings are a result, so the exit code is 0 either way."""
    return judge(options, load)


def load(path: Path) -> Ruleset:
    """Read a ruleset file, or compile a plant (which alone needs the compiler)."""
    if path.suffix == ".json":
        return read_ruleset(path)
    from rulec.passes.pipeline import compile_plant

    return compile_plant(path)
