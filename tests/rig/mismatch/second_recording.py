"""The example of docs/plan-an-experiment.md under other noise, as JSON.

`python -m tests.rig.mismatch.second_recording [--seeds N]`: how many of N first recordings leave
several explanations open, and of how many of those the second one names the truth.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

from rulec.limits import UNSURE
from tests.conftest import ROOT
from tests.figures.ledger import Share
from tests.rig.called import called

PLANT = ROOT / "plants" / "dosing-line"
INPUTS = PLANT / "examples" / "in_proportion.inputs.csv"
TRUTH = "relief-valve"


def form(seeds: int) -> dict[str, Any]:
    """Ask about so many recordings, with the noise of seeds 1, 3, 5..., and about each with that
    of its experiment, with the noise of the next seed."""
    found = []
    for number in range(seeds):
        with tempfile.TemporaryDirectory() as folder:
            found.append(_asked(Path(folder), 2 * number + 1))
    open_ = [both for alone, both in found if alone["verdict"] in ("ambiguous", "unsure")]
    right = sum(_names_the_truth(both) for both in open_)
    return {
        "ambiguous": Share(len(open_), seeds).form(),
        "named right of these": Share(right, len(open_)).form(),
    }


def _asked(folder: Path, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """The answers about the first recording, and about it and its experiment."""
    names = ("first.csv", "first.json", "inputs.csv", "second.csv", "both.json")
    first, alone, inputs, second, both = (folder / name for name in names)
    built, codes = PLANT / "as-built.yaml", (0, UNSURE)
    called("simulate", built, INPUTS, "-o", first, "--noise", seed)
    called("mismatch", PLANT, first, "--json", alone, codes=codes)
    called("experiment", alone, "-o", inputs, codes=codes)
    called("simulate", built, inputs, "-o", second, "--noise", seed + 1)
    called("mismatch", PLANT, first, second, "--json", both, codes=codes)
    read = [json.loads(file.read_text(encoding="utf-8")) for file in (alone, both)]
    return read[0], read[1]


def _names_the_truth(found: dict[str, Any]) -> bool:
    """One effect, the relief valve."""
    names = [effect["effect"] for effect in found["effects"]]
    return found["verdict"] == "named" and names == [TRUTH]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=12)
    print(json.dumps(form(parser.parse_args().seeds), indent=1))
