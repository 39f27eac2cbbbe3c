"""Figures as plain data: `--json`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from tests.figures.share import Share
from tests.rig.mixing_rig.judge import Judged
from tests.rig.mixing_rig.measure import (
    alarm_figures,
    degree_figures,
    grouped,
    isolation_figures,
    pair_figures,
    sample_figures,
)


def leakage_form(judged: Judged) -> dict[str, Any]:
    """Samples judged alone, and plateaus, by plant and mode."""
    form: dict[str, Any] = {}
    for plant, mode in dict.fromkeys((s.group, s.mode) for s in judged.samples):
        parts = [s for s in judged.samples if (s.group, s.mode) == (plant, mode)]
        alone = [sample_figures([part], "A.leakage").error for part in parts]
        figures = asdict(sample_figures(parts, "A.leakage"))
        spread = {"error_spread": float(np.std(alone))}  # from one calibration to the next
        form.setdefault(plant, {})[mode] = {"samples": figures | spread}
    for (plant, mode), answers in _by_group_and_mode(judged).items():
        form[plant][mode]["plateaus"] = asdict(degree_figures(answers))
    return form


def degrees_form(judged: Judged) -> dict[str, Any]:
    """All faults, by mode; the share named rightly with its interval."""
    form = {}
    for mode, answers in grouped(judged.answers, lambda a: a.mode).items():
        found = degree_figures(answers)
        form[mode] = asdict(found) | {"right": Share(found.right, found.points).form()}
    return form


def isolation_form(judged: Judged) -> dict[str, Any]:
    """By plant and number of points, then by degree."""
    groups = grouped(judged.answers, lambda a: a.group)
    return {
        name: {
            degree: asdict(isolation_figures(part))
            for degree, part in grouped(answers, lambda a: f"{a.set_degree:g}").items()
        }
        for name, answers in groups.items()
    }


def pairs_form(judged: Judged) -> dict[str, Any]:
    """By number of points."""
    groups = grouped(judged.answers, lambda a: a.group)
    return {name: asdict(pair_figures(answers)) for name, answers in groups.items()}


def alarms_form(judged: Judged) -> dict[str, Any]:
    """By mode; samples with a fault as a share of all."""
    form = {}
    for mode in dict.fromkeys(c.mode for c in judged.covered):
        covered = [c for c in judged.covered if c.mode == mode]
        found = alarm_figures(covered, [s for s in judged.samples if s.mode == mode])
        form[mode] = asdict(found) | {"fault": Share(found.fault, found.samples).form()}
    return form


FORMS: Mapping[str, Callable[[Judged], dict[str, Any]]] = {
    "leakage": leakage_form,
    "degrees": degrees_form,
    "isolation": isolation_form,
    "pairs": pairs_form,
    "alarms": alarms_form,
}


def _by_group_and_mode(judged: Judged) -> dict[tuple[str, str], list[Any]]:
    found: dict[tuple[str, str], list[Any]] = {}
    for answer in judged.answers:
        found.setdefault((answer.group, answer.mode), []).append(answer)
    return found
