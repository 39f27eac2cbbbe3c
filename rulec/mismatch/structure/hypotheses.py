"""Ways in which a column may differ from its header, whatever the plant does.

Such a hypothesis has no free parameter: its numbers are given, and read otherwise they agree with
the others or they do not. The same holds if a pipe differs from the plant file.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors.units import exchangeable, like_a_reading, mixups
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import never_moves
from rulec_runtime.recordings.stationary import noise_of

from rulec.knowledge.plant import Plant
from rulec.mismatch.result import Finding, Location, Misread, Rewired
from rulec.passes.link import junctions

Pipe = tuple[str, str]
"""The source and the target of a connection."""


@dataclass(frozen=True)
class Rewiring:
    """A pipe as `stated` in the plant file (None: not there), and as it `fits` the readings."""

    stated: Pipe | None
    fits: Pipe | None

    def of(self, connections: Sequence[Pipe]) -> tuple[Pipe, ...]:
        """Connections with the pipe replaced as it fits."""
        if self.stated is None:
            assert self.fits is not None
            return (*connections, self.fits)
        own = () if self.fits is None else (self.fits,)
        at = list(connections).index(self.stated)
        return (*connections[:at], *own, *connections[at + 1 :])

    @property
    def modules(self) -> tuple[str, ...]:
        """Modules at either end, each once."""
        return tuple(dict.fromkeys((*(self.stated or ()), *(self.fits or ()))))

    @property
    def sources(self) -> tuple[str, ...]:
        """Modules whose outlet leads elsewhere than stated."""
        own = [pipe[0] for pipe in (self.stated, self.fits) if pipe is not None]
        return tuple(dict.fromkeys(own))


def rewirings(plant: Plant, off: Mapping[str, float], most: int) -> tuple[Rewiring, ...]:
    """At most `most` other networks that differ by one pipe.

    Any module may feed. Only modules of a type that is fed somewhere in this plant may be fed,
    unlike pumps that draw from vessels. Networks that the compiler refuses, and equal networks, do
    not count.

    `off` is how much each module contradicts others. A pipe between modules without contradiction
    is right. Pipes at modules with the largest contradiction come first.
    """
    known = {junctions(plant)}
    found = []
    for rewiring in _every(plant):
        network = junctions(replace(plant, connections=rewiring.of(plant.connections)))
        if network not in known and any(off.get(m, 0.0) > 0.0 for m in rewiring.modules):
            known.add(network)
            found.append(rewiring)
    found.sort(key=lambda r: -max(off.get(m, 0.0) for m in r.modules))
    return tuple(found[:most])


def _every(plant: Plant) -> Iterator[Rewiring]:
    """Each pipe moved at one end, reversed or removed; then each missing one added."""
    stated = plant.connections
    kind = {name: module.type.name for name, module in plant.modules.items()}
    fed = {kind[target] for _, target in stated}
    sources = list(plant.modules)
    targets = [name for name in plant.modules if kind[name] in fed]

    def is_new(pipe: Pipe) -> bool:
        return pipe[1] in targets and pipe[0] != pipe[1] and pipe not in stated

    for source, target in stated:
        ends = [(source, other) for other in targets] + [(other, target) for other in sources]
        for pipe in filter(is_new, (*ends, (target, source))):
            yield Rewiring((source, target), pipe)
        yield Rewiring((source, target), None)
    for pipe in filter(is_new, product(sources, targets)):
        yield Rewiring(None, pipe)


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
    recorded = [s for s in read if np.isfinite(recording.values.get(s.id, np.zeros(0))).any()]
    for signal in recorded:
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
                    text=f"{signal.id} is in {mixup.true}, not {mixup.written}: its values are "
                    + off,
                    action=f"write {mixup.true} as the unit of {signal.id} in the columns map or "
                    "in the header",
                )
        # A reading with a conventional zero has no other sign.
        if not signal.offset and like_a_reading(signal, -values, noise):
            yield Hypothesis(
                kind=SIGN,
                mending=Mending(signals=(signal.id,), factor=-1.0),
                text=f"{signal.id} has the wrong sign",
                action=f"reverse the sign of {signal.id} where it is recorded",
            )
    moving = [s for s in recorded if not never_moves(recording.values[s.id])]
    for one, other in exchangeable(moving, ruleset.units):
        yield Hypothesis(
            kind=SWAPPED,
            mending=Mending(signals=(one.id, other.id)),
            text=f"the columns {one.id} and {other.id} are swapped",
            action=f"exchange {one.id} and {other.id} in the columns map or in the header",
        )


TITLES = {
    SWAPPED: "Swapped columns",
    UNIT: "Wrong unit",
    SIGN: "Wrong sign",
    CLOCK: "Clock that is off",
    CONNECTION: "Connection that is not as stated",
}
"""Titles of findings by kind."""


def findings_of(taken: Sequence[AcceptedHypothesis]) -> tuple[Finding, ...]:
    """Each as a finding, whose place is the ids of its signals or outlets."""
    found = []
    for one in taken:
        hypothesis, signals = one.hypothesis, one.hypothesis.places
        modules = tuple(dict.fromkeys(name.partition(".")[0] for name in signals))
        found.append(
            Finding(
                id=f"{'+'.join(signals)}.{hypothesis.kind}",
                sort="structure",
                name=hypothesis.kind,
                title=TITLES[hypothesis.kind],
                module=modules[0],
                place=" ".join(signals),
                text=hypothesis.text,
                action=hypothesis.action,
                probability=one.probability,
                gain=one.gain,
                closed=float("nan"),
                members=modules if len(modules) > 1 else (),
            )
        )
    return tuple(found)


def locations_of(taken: Sequence[AcceptedHypothesis], ruleset: Ruleset) -> Iterator[Location]:
    """The signals or outlets of each."""
    for name in (name for one in taken for name in one.hypothesis.places):
        module, _, place = name.partition(".")
        yield Location(module=module, place=place, title=ruleset.modules.get(module, module))


def misread_of(taken: Sequence[AcceptedHypothesis]) -> tuple[Misread, ...]:
    """How to correct each column when the recording is read again, in this order."""
    return tuple(
        Misread(t.hypothesis.kind, t.hypothesis.mending)
        for t in taken
        if t.hypothesis.mending is not None
    )


def rewired_of(taken: Sequence[AcceptedHypothesis]) -> tuple[Rewired, ...]:
    """What must be edited in the plant file before the answer holds."""
    found = []
    for rewiring, edit in ((t.hypothesis.rewiring, t.hypothesis.action) for t in taken):
        if rewiring is not None:
            pipes = (rewiring.stated, rewiring.fits)
            stated, fits = (None if pipe is None else " -> ".join(pipe) for pipe in pipes)
            found.append(Rewired(stated=stated, fits=fits, edit=edit))
    return tuple(found)
