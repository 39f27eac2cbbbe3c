"""A dosing module whose slip follows the temperature, for tests of single steps."""

from __future__ import annotations

import functools

from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.screen import InitialCandidate, screen
from tests.runtime.mismatch.made import USUAL, Built, alone, recorded, rows_at, tour, warming

SAMPLES = 240
SLIP = "A.slip-temperature@Q_geo"
TRUE: Built = {SLIP: {"b": 0.03, "T0": USUAL}}


@functools.cache
def run(warm: bool = True) -> Recording:
    """The recording; healthy if it is not warm."""
    given = {**tour(alone()[0], SAMPLES), "A.T": warming(SAMPLES)}
    return recorded(alone(), given, TRUE if warm else {})


@functools.cache
def plain(warm: bool = True) -> Fitted:
    """The plain model refitted."""
    rows = rows_at(alone(), run(warm))
    return fit(rows, Configuration(), rows.system.data.open)


def joined(fitted: Fitted, trial: InitialCandidate) -> Fitted:
    """A model refitted with a candidate, as a screen found it."""
    setting = fitted.setting.joining(trial.candidate, trial.values, trial.fixed, trial.course)
    return fit(fitted.rows, setting, fitted.used)


@functools.cache
def trial(name: str = SLIP, warm: bool = True) -> InitialCandidate:
    """A candidate as the screen found it."""
    candidate = next(c for c in alone()[1].candidates if c.id == name)
    (found,) = screen(plain(warm), [candidate])
    return found
