"""Peers beside ours on real rigs: `python -m tests.rig.peers RIGS KEPT [--json FILE]`.

RIGS is a folder of rigs, KEPT what `rulec prove --real RIGS --keep KEPT` left.
"""

from __future__ import annotations

import argparse
import tempfile
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console
from rulec_runtime.commands.destinations import without_folder, write_json

from rulec.prove.real.form import rigs_in
from rulec.prove.run_folder import CASES
from tests.rig.peers.case import case_of
from tests.rig.peers.judge import judged
from tests.rig.peers.told import form, tell

NEEDED = ("sklearn", "pysindy")
WIDTH = 200
"""Columns of a table in a file. Origin: numerical, no cell is cut."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.rig.peers", description=__doc__)
    parser.add_argument("rigs", type=Path)
    parser.add_argument("kept", type=Path)
    parser.add_argument("--json", metavar="FILE", help="- for standard output")
    parser.add_argument("--only", default="", help="rigs whose name holds this")
    parser.add_argument("--work", type=Path, help="keep predictions of training there")
    options = parser.parse_args()
    lacking = [name for name in NEEDED if find_spec(name) is None]
    if lacking:
        parser.error(f"{', '.join(lacking)} not installed; pip install '.[prove]'")
    wrong = without_folder(options, "json")
    if wrong:
        parser.error(wrong)
    with tempfile.TemporaryDirectory(prefix="rulec-peers-") as temporary:
        _run(options, options.work or Path(temporary))
    return 0


def _run(options: argparse.Namespace, work: Path) -> None:
    work.mkdir(parents=True, exist_ok=True)
    aside, found = Console(stderr=True), []
    for number, rig in enumerate(rigs_in(options.rigs)):
        if options.only not in rig.name:
            continue
        aside.print(rig.name, highlight=False)
        case = case_of(rig, options.kept / CASES / f"{number:04d}", work)
        if case is not None:
            found.append(judged(case))
    out = Console()
    tell(out if out.is_terminal else Console(width=WIDTH), found)
    write_json(options, form(found))


if __name__ == "__main__":
    raise SystemExit(main())
