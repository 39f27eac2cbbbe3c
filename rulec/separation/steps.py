"""A step for each ambiguous finding: the change of inputs that tells its causes apart."""

from collections.abc import Sequence
from dataclasses import replace

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding, Step
from rulec_runtime.report.wording import worst_first

from rulec.separation.allowed import Allowed
from rulec.separation.distance import Case, FaultMeasure
from rulec.separation.propose import Proposal, propose, step_in_words
from rulec.simulation.equations import Equations, SimulationRefused, equations_of


def add_steps(diagnosis: Diagnosis, allowed: Allowed) -> Diagnosis:
    """The same diagnosis with steps, for the largest finding of each fault.

    Findings of two faults at once and plants with storage get none. If the plant cannot be
    simulated, a note says so.
    """
    unclear = [f for f in worst_first(diagnosis.findings) if f.alternatives and not f.together]
    if not unclear:
        return diagnosis
    if diagnosis.ruleset.dynamics is not None:
        note = "no step is proposed that tells faults apart: this plant has storage"
        return replace(diagnosis, notes=(*diagnosis.notes, note))
    try:
        equations = equations_of(diagnosis.ruleset)
    except SimulationRefused as refused:
        note = f"no step is proposed that tells faults apart: {refused}"
        return replace(diagnosis, notes=(*diagnosis.notes, note))
    steps = {id(f): step_of(equations, allowed, f) for f in unclear}
    found = tuple(replace(f, step=steps.get(id(f))) for f in diagnosis.findings)
    return replace(diagnosis, findings=found)


def step_of(equations: Equations, allowed: Allowed, finding: Finding) -> Step:
    """The change that tells a finding from its alternatives, starting where it shows most."""
    ruleset, readings = equations.ruleset, dict(finding.readings)
    signals = equations.given_signals
    measure = FaultMeasure(
        equations=equations,
        present={s.id: readings.get(s.id, s.reference) for s in signals},
        rows=(),
        baseline=finding.baseline > 0,
        bounds=allowed.readings,
    )
    rows: dict[str, list[Case]] = {}
    for name, _ in finding.alternatives:
        # The finding taken for another cause, and vice versa.
        other = ruleset.fault_by_id[name]
        rows[name] = [(finding.fault, finding.degree, other)]
        degree = measure.degree_of(other, finding.fault, finding.degree)
        # A cause that cannot look like the finding here has no degree for the second case.
        if degree > 0.0:
            rows[name].append((other, degree, finding.fault))
    present = {s.id: s.shown(measure.present[s.id]) for s in signals}

    def proposed(names: Sequence[str]) -> Proposal:
        return propose(allowed, present, replace(measure, rows=[rows[name] for name in names]))

    names, listed = [*rows], [name for name in rows if not ruleset.fault_by_id[name].unlisted]
    proposal = proposed(names)
    if 0 < len(listed) < len(names):
        # Faults that no module lists are too rare to spoil product for.
        cheaper = proposed(listed)
        if len(cheaper.costs) < len(proposal.costs):
            names, proposal = listed, cheaper
    changes = tuple(
        (name, measure.present[name], allowed.inputs[name].si(shown))
        for name, shown in proposal.changes.items()
    )
    return Step(
        changes=changes,
        apart=tuple(zip(names, proposal.here, proposal.apart, strict=True)),
        ramp=proposal.ramp,
        dwell=proposal.hold,
        costs=proposal.costs,
        text=step_in_words(ruleset, allowed, present, finding.fault.id, names, proposal),
    )
