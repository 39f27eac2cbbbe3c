"""Word the verdict of a diagnosis in one sentence, the heading of its page."""

from collections.abc import Mapping

import numpy as np

from rulec_runtime import limits
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.report.blindness import undetectable
from rulec_runtime.report.text import counted, degree, fixed, percent
from rulec_runtime.report.wording import STATUS, titled, worst_first


def verdict(diagnosis: Diagnosis) -> str:
    """The worst finding with its size; else that nothing was found, or why that is not known."""
    found = {f.fault.id for f in diagnosis.findings}
    text, more = "", 0
    if diagnosis.sensors:
        first = diagnosis.sensors[0]
        text = f"{first.condition.title}: {first.signal or 'time'}"
        more = len(diagnosis.sensors) - 1 + len(found)
    elif diagnosis.regimes:
        regime = diagnosis.regimes[0].regime
        text = f"{regime.title} in {regime.module}"
        more = len({r.regime.id for r in diagnosis.regimes} | found) - 1
    elif found:
        worst = worst_first(diagnosis.findings)[0]
        either = [name for name, p in worst.alternatives if p > limits.HEADLINE_RIVAL]
        named = [worst.fault, *(diagnosis.ruleset.fault_by_id[name] for name in either)]
        text = " or ".join(map(titled, named))
        # Each of two possible causes would have its own degree.
        text = f"{text[:1].upper()}{text[1:]}" + ("" if either else f": {size_of(worst)}")
        more = len(found - {worst.fault.id, *either})
    if text:
        return f"{text}, and {counted(more, 'other finding')}" if more else text
    if not diagnosis.judged:
        return "Nothing could be judged"
    if diagnosis.unknown:
        if all(p.from_sheet for p in diagnosis.unknown):
            return "Not as its sheet says, from the first sample"
        return "Something is wrong, but nothing known explains it"
    if diagnosis.blind:
        return f"No fault found, but {undetectable(diagnosis)}"
    return "No fault found"


def size_of(finding: Finding) -> str:
    """The degree with the half width of its 95 % bounds, both to the digits of the latter."""
    value, unit = finding.degree, finding.fault.unit
    half = max(finding.upper - value, value - finding.lower)
    if not np.isfinite(half) or half <= 0.0:
        return degree(value, unit) if unit else percent(value)
    scale, shown = (1.0, f"\u00a0{unit}") if unit else (100.0, "\u00a0%")
    value, half = scale * value, scale * half
    # One digit of an uncertainty is significant, or two if the first is 1.
    exponent = int(np.floor(np.log10(half)))
    digits = max(0, -exponent + (1 if round(half / 10.0**exponent, 1) < 2.0 else 0))
    return f"{fixed(value, digits)}{shown} ± {fixed(half, digits)}{shown}"


def meaning(diagnosis: Diagnosis) -> str:
    """The letter of NE 107 in words, and the share that was judged."""
    share = diagnosis.judged / max(diagnosis.samples, 1)
    words = STATUS[diagnosis.status][1]
    return f"{words[:1].upper()}{words[1:]}; {percent(share)} of the recording was judged"


def marks(diagnosis: Diagnosis) -> Mapping[str, str]:
    """Modules with a finding, each with its worst letter."""
    found = [(f.fault.module, f.fault.status) for f in diagnosis.findings]
    found += [(s.signal.partition(".")[0], s.condition.status) for s in diagnosis.sensors]
    found += [(r.regime.module, r.regime.status) for r in diagnosis.regimes]
    worst = list(STATUS).index
    return {name: min((x for other, x in found if other == name), key=worst) for name, _ in found}
