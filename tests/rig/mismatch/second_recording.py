"""The example of docs/plan-an-experiment.md under other noise, as JSON.

`python -m tests.rig.mismatch.second_recording [--seeds N]`: how many of N first recordings leave
several explanations open, and of how many of those the second one names the truth.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
from pathlib import Path
from typing import Any

from rulec.cli import main
from rulec.limits import UNSURE
from tests.conftest import ROOT
from tests.figures.share import Share

PLANT = ROOT / "plants" / "dosing-line"
INPUTS = PLANT / "examples" / "in_proportion.inputs.csv"
TRUTH = "relief-valve"


def form(seeds: int) -> dict[str, Any]:
    """Ask about so many recordings, with the noise of seeds 1, 3, 5..., and about each with that
    of its experiment, with the noise of the next seed."""
    first: list[dict[str, Any]] = []
    both: list[dict[str, Any]] = []
    for number in range(seeds):
        with tempfile.TemporaryDirectory() as folder:
            alone, together = _asked(Path(folder), 2 * number + 1)
        first.append(alone)
        both.append(together)
    open_ = [found["verdict"] in ("ambiguous", "unsure") for found in first]
    right = [_names_the_truth(found) for found in both]
    return {
        "ambiguous": Share(sum(open_), seeds).form(),
        "named right of these": Share(
            sum(r for o, r in zip(open_, right, strict=True) if o), sum(open_)
        ).form(),
        "named right of all": Share(sum(right), seeds).form(),
        "verdicts": [[a["verdict"], b["verdict"]] for a, b in zip(first, both, strict=True)],
    }


def _asked(folder: Path, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """The answers about the first recording, and about it and its experiment."""
    names = ("first.csv", "first.json", "inputs.csv", "second.csv", "both.json")
    first, alone, inputs, second, both = (str(folder / name) for name in names)
    built, plant = str(PLANT / "as-built.yaml"), str(PLANT)
    _run("simulate", built, str(INPUTS), "-o", first, "--noise", str(seed))
    _run("mismatch", plant, first, "--json", alone)
    _run("experiment", alone, "-o", inputs)
    _run("simulate", built, inputs, "-o", second, "--noise", str(seed + 1))
    _run("mismatch", plant, first, second, "--json", both)
    read = [json.loads(Path(file).read_text(encoding="utf-8")) for file in (alone, both)]
    return read[0], read[1]


def _run(*command: str) -> None:
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(list(command)) in (0, UNSURE), command


def _names_the_truth(found: dict[str, Any]) -> bool:
    """One effect, the relief valve."""
    names = [effect["effect"] for effect in found["effects"]]
    return found["verdict"] == "named" and names == [TRUTH]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=12)
    print(json.dumps(form(parser.parse_args().seeds), indent=1))
