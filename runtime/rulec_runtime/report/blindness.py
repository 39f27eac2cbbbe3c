"""Word the blindness to faults, alike for a recording, a page, and beside the plant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings.plant_calendar import moment, span
from rulec_runtime.report.text import listed

if TYPE_CHECKING:  # words alone need nothing that judges recordings
    from rulec_runtime.diagnosis.diagnose import Diagnosis
    from rulec_runtime.diagnosis.hidden_faults import Blind
    from rulec_runtime.diagnosis.steady.findings import Period
    from rulec_runtime.recordings.plant_calendar import Calendar

PARTLY = "Partly blind"


def blindness(ruleset: Ruleset, blind: Blind, calendar: Calendar | None = None) -> str:
    """Which faults cannot be detected, since when, why, and which readings they need."""
    return f"{unseen(ruleset, blind)} {since_when(blind, calendar)}: {why_and_how(blind)}"


def since_when(blind: Blind, calendar: Calendar | None) -> str:
    """Since when faults have been undetectable, or the period in which they were."""
    if blind.active:
        return f"since {moment(calendar, blind.since)}"
    return f"in {span(calendar, blind.since, blind.until)}"


def why_and_how(blind: Blind) -> str:
    """The reason, and the readings that the faults need."""
    return f"{blind.because}; {brought_back(blind)}"


def unseen(ruleset: Ruleset, blind: Blind) -> str:
    """Faults that cannot be detected, as `named` groups them."""
    return f"cannot detect {listed(list(named(ruleset, blind.faults)))}"


def brought_back(blind: Blind) -> str:
    """The readings that are needed to detect the faults."""
    are = "is" if len(blind.readings) == 1 else "are"
    them = "it" if len(blind.faults) == 1 else "them"
    return f"{listed(blind.readings)} {are} needed to detect {them}"


def undetectable(diagnosis: Diagnosis) -> str:
    """How many of the faults could not be detected."""
    count = len({fault for one in diagnosis.blind for fault in one.faults})
    every = len(diagnosis.ruleset.faults)
    return f"{count} of {plural(every, 'fault', 'faults')} could not be detected"


def not_judged(diagnosis: Diagnosis) -> tuple[Period, ...]:
    """Periods that were not judged, except those reported as blindness."""
    return tuple(p for p in diagnosis.not_judged if not (diagnosis.blind and p.lost))


def named(ruleset: Ruleset, faults: Iterable[str]) -> Iterator[str]:
    """Faults in few words, in the order of their modules.

    All faults of a module count as one, and so do all errors of a sensor.
    """
    by_module: dict[str, list[FaultSpec]] = {}
    for fault in ruleset.faults:
        by_module.setdefault(fault.module, []).append(fault)
    chosen = set(faults)
    for module, own in by_module.items():
        lost = [f for f in own if f.id in chosen]
        if lost and len(lost) == len(own) > 1:
            yield f"any fault of {module}"
            continue
        alike: dict[str, list[FaultSpec]] = {}
        for f in own:
            alike.setdefault(f.scales[0] if f.in_sensor and f.scales else f.id, []).append(f)
        whole = [name for name, all_ in alike.items() if len(all_) > 1 and set(all_) <= set(lost)]
        yield from (f.id for f in lost if not any(f in alike[name] for name in whole))
        yield from (f"errors of {name}" for name in whole)
