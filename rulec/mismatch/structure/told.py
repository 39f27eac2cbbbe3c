"""Columns that are not what their header says, as findings and places of the answer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rulec_runtime.contract.ruleset import Ruleset

from rulec.mismatch.result import Finding, Location, Misread
from rulec.mismatch.structure.hypotheses import CLOCK, SIGN, SWAPPED, UNIT, Taken

TITLES = {
    SWAPPED: "Swapped columns",
    UNIT: "Wrong unit",
    SIGN: "Wrong sign",
    CLOCK: "Clock that is off",
}
"""By kind: what a finding is called."""

SORT = "structure"
"""What these findings are: neither the plant nor a sensor errs, but the table."""


def findings_of(taken: Sequence[Taken]) -> tuple[Finding, ...]:
    """Each as a finding; its place is the ids of its signals."""
    return tuple(_finding(one) for one in taken)


def _finding(one: Taken) -> Finding:
    signals = one.hypothesis.mending.signals
    modules = tuple(dict.fromkeys(name.partition(".")[0] for name in signals))
    return Finding(
        id=f"{'+'.join(signals)}.{one.hypothesis.kind}",
        sort=SORT,
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


def places_of(taken: Sequence[Taken], ruleset: Ruleset) -> Iterator[Location]:
    """The signals of each."""
    for one in taken:
        for name in one.hypothesis.mending.signals:
            module, _, place = name.partition(".")
            yield Location(
                module=module,
                place=place,
                title=ruleset.modules.get(module, module),
                share=float("nan"),
                region=(),
                periods=(),
            )


def misread_of(taken: Sequence[Taken]) -> tuple[Misread, ...]:
    """What whoever reads the recording again must do to each column, in this order."""
    return tuple(Misread(t.hypothesis.kind, t.hypothesis.mending) for t in taken)
