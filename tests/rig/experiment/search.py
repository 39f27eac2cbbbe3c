"""Sets of explanations grown from the best ones, each refitted, and what they say together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.rows import Rows
from tests.rig.experiment.model import Geometry, Model, refitted
from tests.rig.experiment.scan import (
    NAMELESS,
    ODDS,
    ONSETS,
    WORTH,
    Found,
    columns,
    joined,
    nameless,
    scan,
    terms,
)

WIDTH, ROUNDS, LARGEST, REFITTED = 2, 8, 4, 12
"""Sets that are grown in a round, rounds, explanations of a set, sets that are refitted of each."""

NAMELESS_REFITTED = 3
"""Terms without a name that are refitted of each set."""

LET_GO = -2.0
"""Log odds of a calibration that no longer holds [assumed]."""

Names = frozenset[str]


@dataclass(frozen=True)
class Posterior:
    """Probability of nothing, of each explanation, and of each set; `refits` counts them."""

    nothing: float
    names: Mapping[str, float]
    sets: Mapping[Names, float]
    refits: int


def search(rows: Rows) -> Posterior:
    """The probability of each explanation of a recording."""
    geometry = Geometry(rows)
    number = len({c.id for c in rows.system.candidates})
    models: dict[Names, tuple[float, Model]] = {}
    plain = refitted(geometry, Configuration())
    models[frozenset()] = plain.evidence, plain
    grown: set[Names] = set()
    for _ in range(ROUNDS):
        best = sorted(models, key=lambda names: -models[names][0])[:WIDTH]
        todo = [names for names in best if names not in grown]
        for names in todo:
            grown.add(names)
            _grow(geometry, models, names, number)
        if not todo:
            break
    most = max(score for score, _ in models.values())
    weight = {names: float(np.exp(score - most)) for names, (score, _) in models.items()}
    total = sum(weight.values())
    sets = {names: w / total for names, w in weight.items()}
    every = {name for names in sets for name in names}
    return Posterior(
        sets[frozenset()],
        {name: sum(p for names, p in sets.items() if name in names) for name in sorted(every)},
        sets,
        len(models),
    )


def _grow(
    geometry: Geometry, models: dict[Names, tuple[float, Model]], names: Names, number: int
) -> None:
    """Refit a set with what would gain most beside it, and without each of its members."""
    model = models[names][1]
    if len(names) < LARGEST:
        for found in scan(geometry, model, columns(geometry, model), REFITTED):
            if names | found.names not in models:
                scored = _with(geometry, model, found, number)
                if scored is not None:
                    models[names | found.names] = scored
        every = terms(geometry, model)
        for gain, term in nameless(model, every, NAMELESS_REFITTED):
            if gain > WORTH and names | {term.name} not in models:
                refit = refitted(geometry, model.setting, model, (*model.terms, term))
                cost = NAMELESS - float(np.log(len(every)))
                models[names | {term.name}] = _score(refit, number, cost * len(refit.terms)), refit
    for candidate in model.setting.joined if len(names) > 1 else ():
        less = frozenset(n for n in names if n.rstrip("!") != candidate.id)
        if less not in models:
            bare = refitted(geometry, model.setting.leaving(candidate.id), model, model.terms)
            models[less] = _score(bare, number, _unnamed(geometry, model)), bare


def _with(
    geometry: Geometry, model: Model, found: Found, number: int
) -> tuple[float, Model] | None:
    """The better of two: calibrations held, and those under new physics let go."""
    setting = joined(geometry.rows.system, model.setting, found.starts)
    new = [column.candidate for column, _ in found.starts]
    modules = frozenset(m for c in new if c.sort in ("physics", "ageing") for m in c.modules)
    ways = [setting] if modules <= setting.released else [setting, setting.letting_go(modules)]
    scored = []
    for way in ways:
        try:
            refit = refitted(geometry, way, model, model.terms)
        except np.linalg.LinAlgError:
            continue
        scored.append((_score(refit, number, _unnamed(geometry, model)), refit))
    return max(scored, key=lambda s: s[0], default=None)


def _unnamed(geometry: Geometry, model: Model) -> float:
    """What terms without a name cost before the recording."""
    if not model.terms:
        return 0.0
    return len(model.terms) * (NAMELESS - float(np.log(len(terms(geometry, model)))))


def _score(model: Model, number: int, unnamed: float = 0.0) -> float:
    """Evidence and what was expected before the recording, in nats."""
    setting = model.setting
    expected = sum(ODDS[c.sort] - np.log(number) for c in setting.joined)
    expected += LET_GO * len(setting.released) - np.log(ONSETS) * len(setting.courses)
    return model.evidence + float(expected) + unnamed
