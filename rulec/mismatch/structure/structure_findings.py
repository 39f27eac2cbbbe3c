"""Columns and connections that are not as stated, as findings and places."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rulec_runtime.contract.ruleset import Ruleset

from rulec.mismatch.result import Finding, Location, Misread, Rewired
from rulec.mismatch.structure.hypotheses import (
    CLOCK,
    CONNECTION,
    SIGN,
    SWAPPED,
    UNIT,
    AcceptedHypothesis,
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
    return tuple(_finding(one) for one in taken)


def _finding(one: AcceptedHypothesis) -> Finding:
    signals = one.hypothesis.places
    modules = tuple(dict.fromkeys(name.partition(".")[0] for name in signals))
    return Finding(
        id=f"{'+'.join(signals)}.{one.hypothesis.kind}",
        sort="structure",
        name=one.hypothesis.kind,
        title=TITLES[one.hypothesis.kind],
        module=modules[0],
        place=" ".join(signals),
        parameters={},
        equation="",
        text=one.hypothesis.text,
        action=one.hypothesis.action,
        source="",
        probability=one.probability,
        alternatives=(),
        gain=one.gain,
        rivals=(),
        periods=(),
        closed=float("nan"),
        members=modules if len(modules) > 1 else (),
    )


def places_of(taken: Sequence[AcceptedHypothesis], ruleset: Ruleset) -> Iterator[Location]:
    """The signals or outlets of each."""
    for one in taken:
        for name in one.hypothesis.places:
            module, _, place = name.partition(".")
            yield Location(
                module=module,
                place=place,
                title=ruleset.modules.get(module, module),
                share=float("nan"),
                region=(),
                periods=(),
            )


def misread_of(taken: Sequence[AcceptedHypothesis]) -> tuple[Misread, ...]:
    """How to correct each column when the recording is read again, in this order."""
    return tuple(
        Misread(t.hypothesis.kind, t.hypothesis.mending)
        for t in taken
        if t.hypothesis.mending is not None
    )


def rewired_of(taken: Sequence[AcceptedHypothesis]) -> tuple[Rewired, ...]:
    """What must be edited in the plant file before the answer holds."""
    return tuple(
        Rewired(
            stated=_pipe(t.hypothesis.rewiring.stated),
            fits=_pipe(t.hypothesis.rewiring.fits),
            edit=t.hypothesis.action,
        )
        for t in taken
        if t.hypothesis.rewiring is not None
    )


def _pipe(pipe: tuple[str, str] | None) -> str | None:
    return None if pipe is None else " -> ".join(pipe)
