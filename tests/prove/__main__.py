"""Held-out errors on real recordings as JSON: `python -m tests.prove --only NAME --json -`.

The same analysis as `rulec prove --real`; by recording and reading, in the unit of the reading.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rulec.engines.call import Engine
from tests.conftest import recordings_folder
from tests.prove.real import Answer, answers
from tests.prove.tell_real import MODELS

Errors = Mapping[str, float | None]


def form(found: Sequence[Answer]) -> dict[str, dict[str, Errors]]:
    """By recording and signal: errors of the three models, and the noise; null where unknown."""
    return {answer.case: dict(map(_errors, answer.form.get("fits") or ())) for answer in found}


def _errors(fit: Mapping[str, Any]) -> tuple[str, Errors]:
    return fit["signal"], {name: fit["heldout"][name] for name in (*MODELS, "noise")}


def _quiet(what: str, done: int, all_: int) -> None:
    """Nobody watches."""


def main() -> None:
    """Ask about the recordings that are here and have the name; print."""
    parser = argparse.ArgumentParser(prog="python -m tests.prove", description=__doc__)
    parser.add_argument("--only", default="", metavar="NAME", help="or a part of it")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--json", choices=("-",), default="-", help="JSON is all there is")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        found, _ = answers(
            recordings_folder(), Path(work), options.only, Engine(jobs=options.jobs), _quiet
        )
    print(json.dumps(form(found), indent=1))


if __name__ == "__main__":
    main()
