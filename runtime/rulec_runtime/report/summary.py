"""All findings of a diagnosis as a table: a row each, or one per fault if there are many."""

from collections.abc import Callable, Sequence

from rich.text import Text

from rulec_runtime.contract.degree import degree_in_figures
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.recordings.plant_calendar import course
from rulec_runtime.report.parts import Table
from rulec_runtime.report.text import listed, percent
from rulec_runtime.report.wording import LISTED


def summary(
    diagnosis: Diagnosis,
    named: Callable[[FaultSpec], Sequence[str | Text]],
    *first: str,
    others: bool = False,
) -> Table:
    """Fault, degree with bounds, period, mean probability, and with `others` what else it could be,
    if there is anything; the most frequent faults first. `named` gives the first cells of a row,
    which have the titles `first`."""
    groups: dict[object, list[Finding]] = {}
    for i, finding in enumerate(diagnosis.findings):
        many = len(diagnosis.findings) > LISTED
        groups.setdefault(finding.fault.id if many else i, []).append(finding)
    rows, others = [], others and any(f.alternatives for f in diagnosis.findings)
    for members in sorted(groups.values(), key=lambda own: -len(own)):
        last, times = max(members, key=lambda f: f.until), len(members)
        fault, degrees = last.fault, [f.degree for f in members]
        when = course(diagnosis.calendar, members[0].since, last.until, last.behind, short=True)
        alike = max(degrees) - min(degrees) < 5e-4 * fault.scale  # once rounded
        weighed = percent(sum(f.probability for f in members) / times)
        cells = [
            *named(fault),
            degree_in_figures(fault, min(degrees), None if alike else max(degrees)),
            degree_in_figures(fault, min(f.lower for f in members), max(f.upper for f in members)),
            f"{times} times, {when}" if times > 1 else when,
            weighed if diagnosis.mode != "paper" else "–",
        ]
        if others:
            cells.append(listed([*dict.fromkeys(n for f in members for n, _ in f.alternatives)]))
        rows.append(cells)
    titles = [*first, ".degree", ".95 % bounds", "when", ".probability"]
    titles += ["could also be"] * others
    # On a narrow terminal periods wrap; names and numbers stay whole.
    return Table(titles, rows, "all findings", broken=("when",))
