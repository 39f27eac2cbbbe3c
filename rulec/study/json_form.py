"""A study as JSON data, with all counts."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset

from rulec.study.campaign import Settings
from rulec.study.points import Points
from rulec.study.summary import sentences
from rulec.study.tally import Cell, Tally
from rulec.study.without import without_each


def study_form(
    ruleset: Ruleset, points: Points, settings: Settings, counts: Tally
) -> dict[str, Any]:
    """Plain data; readings in SI. The `kinds` of a cell sum up to all its recordings."""
    return {
        "plant": ruleset.plant,
        "ruleset": ruleset.sources,
        "settings": asdict(settings),
        "points": [
            {name: float(values[i]) for name, values in points.given.items()}
            for i in range(len(points))
        ],
        "faults": [_cell(cell) for cell in counts.cells],
        "confusions": [asdict(confusion) for confusion in counts.confusions],
        "healthy": asdict(counts.healthy),
        "lead_in": asdict(counts.lead_in),
        "without": without_each(ruleset),
        "text": list(sentences(counts)),
    }


def _cell(cell: Cell) -> dict[str, Any]:
    return {
        **asdict(cell.fault),
        "degree": cell.degree,
        "kinds": {kind.value: count for kind, count in cell.kinds.items()},
        "recordings": cell.recordings,
        "found": cell.found,
        "named": cell.named,
        "shared": cell.shared,
        "covered": cell.covered,
        "error": cell.error if cell.named else None,
        "bias": cell.bias if cell.named else None,
    }
