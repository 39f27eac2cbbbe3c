"""The repaired ZeMA plant of the README as JSON: `python -m tests.rig.mismatch.zema_form`."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.conftest import recordings_folder
from tests.figures.share import Share
from tests.rig.mismatch.ask import ask
from tests.rig.mismatch.zema import prepare, repair
from tests.rig.zema import Score

ASKED = "zema full"


def form(folder: Path) -> dict[str, Any]:
    """Ask about half of the blocks, adopt, and judge both plants on the others."""
    with tempfile.TemporaryDirectory() as place:
        work = Path(place)
        case = next(c for c in prepare(folder, work) if c.name == ASKED)
        found = repair(case, ask(case, work), folder, work)
    plants = {
        "shipped": (found.shipped, found.detectable[0], found.before),
        "repaired": (found.repaired, found.detectable[1], found.after),
    }
    return {
        name: {
            "flow error": round(error, 6),
            "smallest leakage": round(smallest, 6),
            "healthy alarmed": _share(score.alarmed, score.cycles, "none").form(),
            "weak found": _share(score.leak_named, score.cycles, "weak, settled").form(),
            "severe found": _share(score.leak_named, score.cycles, "severe, settled").form(),
        }
        for name, (error, smallest, score) in plants.items()
        if isinstance(score, Score)
    }


def _share(part: Mapping[str, int], whole: Mapping[str, int], word: str) -> Share:
    """Over cycles on their profile."""
    keys = [key for key in whole if key.startswith(word) and "off profile" not in key]
    return Share(sum(part[key] for key in keys), sum(whole[key] for key in keys))


if __name__ == "__main__":
    print(json.dumps(form(recordings_folder()), indent=1))
