"""Ways in which a column may differ from its header, whatever the plant does.

Such a hypothesis has no free parameter: its numbers are given, and read otherwise they agree with
the others or they do not. The same holds if a pipe differs from the plant file.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors.units import exchangeable, like_a_reading, mixups
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import never_moves
from rulec_runtime.recordings.stationary import noise_of

from rulec.mismatch.structure.connections import Rewiring

SWAPPED, UNIT, SIGN, CLOCK = "swapped-columns", "wrong-unit", "wrong-sign", "clock-shift"
CONNECTION = "wrong-connection"
"""Kinds of hypotheses, as in the JSON form."""


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """One way to read a recording, or to connect its plant; `text` and `action` for people."""

    kind: str
    text: str
    action: str
    mending: Mending | None = None
    rewiring: Rewiring | None = None

    @property
    def places(self) -> tuple[str, ...]:
        """Signals that are read otherwise, or outlets that lead elsewhere."""
        if self.mending is not None:
            return self.mending.signals
        sources = () if self.rewiring is None else self.rewiring.sources
        return tuple(f"{name}.outlet" for name in sources)


@dataclass(frozen=True)
class AcceptedHypothesis:
    """A hypothesis that was accepted: its gain, nats, and its probability."""

    hypothesis: Hypothesis
    gain: float
    probability: float


def hypotheses(
    recording: Recording, ruleset: Ruleset, read: Sequence[SignalSpec]
) -> Iterator[Hypothesis]:
    """All hypotheses on the readings that a model reads."""
    known = [s for s in read if np.isfinite(recording.values.get(s.id, np.zeros(0))).any()]
    for signal in known:
        yield from _units(recording, ruleset, signal)
        yield from _sign(recording, signal)
    moving = [s for s in known if not never_moves(recording.values[s.id])]
    for one, other in exchangeable(moving, ruleset.units):
        yield Hypothesis(
            kind=SWAPPED,
            mending=Mending(signals=(one.id, other.id)),
            text=f"the columns {one.id} and {other.id} are swapped",
            action=f"exchange {one.id} and {other.id} in the columns map or in the header",
        )


def _units(recording: Recording, ruleset: Ruleset, signal: SignalSpec) -> Iterator[Hypothesis]:
    values = recording.values[signal.id]
    noise = noise_of(values)
    scale = recording.scales.get(signal.id, (signal.factor, signal.offset))
    for mixup in mixups(signal, scale, ruleset.units):
        there = values * mixup.factor + mixup.offset
        if like_a_reading(signal, there, noise * mixup.factor):
            times = max(mixup.factor, 1.0 / mixup.factor)
            off = f"{times:.4g} times too {'large' if mixup.factor < 1.0 else 'small'}"
            off = "counted from another zero" if mixup.offset else off
            yield Hypothesis(
                kind=UNIT,
                mending=Mending(signals=(signal.id,), factor=mixup.factor, offset=mixup.offset),
                text=f"{signal.id} is in {mixup.true}, not {mixup.written}: its values are {off}",
                action=f"write {mixup.true} as the unit of {signal.id} in the columns map or in "
                "the header",
            )


def _sign(recording: Recording, signal: SignalSpec) -> Iterator[Hypothesis]:
    """The other sign; a reading with a conventional zero has none."""
    values = recording.values[signal.id]
    if signal.offset or not like_a_reading(signal, -values, noise_of(values)):
        return
    yield Hypothesis(
        kind=SIGN,
        mending=Mending(signals=(signal.id,), factor=-1.0),
        text=f"{signal.id} has the wrong sign",
        action=f"reverse the sign of {signal.id} where it is recorded",
    )
