"""Peers beside ours on real rigs, as JSON: `python -m tests.rig.peers RIGS KEPT`.

RIGS is a folder of rigs, KEPT what `rulec prove --real RIGS --keep KEPT` left.
"""

import argparse
import json
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from rulec.prove.campaign import CASES
from rulec.prove.real.rig_folder import rigs_in
from tests.rig.peers.case import case_of
from tests.rig.peers.judge import judged
from tests.rig.peers.told import form

NEEDED = ("sklearn", "pysindy")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.rig.peers", description=__doc__)
    parser.add_argument("rigs", type=Path)
    parser.add_argument("kept", type=Path)
    parser.add_argument("--only", default="", help="rigs whose name holds this")
    options = parser.parse_args()
    lacking = [name for name in NEEDED if find_spec(name) is None]
    if lacking:
        parser.error(f"{', '.join(lacking)} not installed; pip install '.[prove]'")
    found = []
    with tempfile.TemporaryDirectory(prefix="rulec-peers-") as work:
        for number, rig in enumerate(rigs_in(options.rigs)):
            if options.only in rig.name:
                print(rig.name, file=sys.stderr)
                case = case_of(rig, options.kept / CASES / f"{number:04d}", Path(work))
                found += [] if case is None else [judged(case)]
    print(json.dumps(form(found), indent=1))


if __name__ == "__main__":
    main()
