"""The counts of a study in words."""

from collections.abc import Iterator, Mapping, Sequence

from rulec_runtime.report.text import counted

from rulec.study.campaign import Kind
from rulec.study.limits import BLIND, CONFUSED, FEW, MOST_CONFUSIONS, RELIABLE
from rulec.study.tally import Cell, FaultKind, Tally

TITLES = ("degree", "runs", "found", "named", "listed", "error", "bias", "in bounds")
"""Titles of the columns of a table, after the fault."""

LEGEND = (
    "found: an alarm is raised. named: the true fault comes first; listed: it comes "
    "first or is an alternative. Degree where named: mean absolute error, mean error, and how "
    "often the bounds hold the true one."
)


def rows_of(tally: Tally) -> dict[FaultKind, list[Cell]]:
    """Cells by fault kind, in order of degree."""
    rows: dict[FaultKind, list[Cell]] = {}
    for cell in tally.cells:
        rows.setdefault(cell.fault, []).append(cell)
    return {kind: sorted(cells, key=lambda c: c.degree) for kind, cells in rows.items()}


def per_type(tally: Tally, types: Mapping[str, str]) -> Iterator[tuple[str, str, list[list[Cell]]]]:
    """Name, modules and rows of each module type with faults."""
    every = rows_of(tally)
    for kind in dict.fromkeys(types.values()):
        rows = [cells for of, cells in every.items() if of.type == kind]
        if rows:
            yield kind, ", ".join(name for name, type_ in types.items() if type_ == kind), rows


def reliable_from(cells: Sequence[Cell]) -> float | None:
    """Smallest degree above which the fault is found, and named first or as an alternative."""
    smallest = None
    for cell in sorted((c for c in cells if c.recordings), key=lambda c: -c.degree):
        if min(cell.found, cell.named + cell.shared) < RELIABLE * cell.recordings:
            break
        smallest = cell.degree
    return smallest


def verdict(tally: Tally) -> str:
    """How many kinds of fault are found and named, and the number of false alarms."""
    rows = [cells for cells in rows_of(tally).values() if any(c.recordings for c in cells)]
    reliable = sum(reliable_from(cells) is not None for cells in rows)
    healthy = tally.healthy
    return (
        f"Detected and identified: {reliable} of {counted(len(rows), 'kind')} of fault; "
        f"{counted(healthy.alarms, 'false alarm')} in {healthy.recordings} healthy recordings"
    )


def sentences(tally: Tally) -> Iterator[str]:
    """Findings in order: what is reliable, what is not, what is confused, false alarms."""
    groups: dict[tuple[int, float, str], list[FaultKind]] = {}
    for kind, cells in rows_of(tally).items():
        # At a large degree a plant may have no operating point.
        if ran := [cell for cell in cells if cell.recordings]:
            groups.setdefault(_detected(ran), []).append(kind)
    for (*_, words), kinds in sorted(groups.items()):
        yield f"{words}: {_names(kinds)}."
    frequent = [c for c in tally.confusions if c.count >= CONFUSED * c.of]
    for c in frequent[:MOST_CONFUSIONS]:
        yield (
            f"Confused: {c.fault.title} of {c.fault.type} is taken for {c.taken_for.title} of "
            f"{c.taken_for.type} in {c.count} of {c.of} recordings."
        )
    if named := sum(c.named for c in tally.cells):
        error = sum(c.error * c.named for c in tally.cells) / named
        bias = sum(c.bias * c.named for c in tally.cells) / named
        yield (
            f"Degree, where the true fault is named first: off by {error:.3f} on average (bias "
            f"{bias:+.3f}); its bounds hold the true one in {sum(c.covered for c in tally.cells)} "
            f"of {named} recordings."
        )
    healthy, early = tally.healthy, tally.lead_in
    before = f" Before the fault set in: {early.alarms} of {early.recordings}."
    yield (
        f"False alarms: {healthy.alarms} of {healthy.recordings} healthy recordings "
        f"({healthy.samples} samples); with 95 % confidence less than {percent(healthy.bound)}."
        f"{before if early.recordings else ''}"
    )
    if lost := sum(c.kinds[Kind.NO_POINT] for c in tally.cells):
        left = counted(lost, "recording")
        yield f"Left out: {left}, because the plant has no operating point there."


def _detected(cells: Sequence[Cell]) -> tuple[int, float, str]:
    """How well a kind of fault is seen, in words; behind two numbers by which these are ordered."""
    degree, largest = reliable_from(cells), cells[-1]
    if degree is not None:
        words = "Detected and identified (first or as an alternative)"
        return 0, degree, f"{words} from {percent(degree)} on"
    share = largest.found / largest.recordings
    if share >= RELIABLE:
        return 1, 0.0, "Detected, but not always identified"
    if share >= BLIND:
        return 2, 0.0, "Not always detected, even at the largest degree"
    return 3, 0.0, "Cannot be seen"


def _names(kinds: Sequence[FaultKind]) -> str:
    """Faults with their module type, each type named once."""
    by_type: dict[str, list[str]] = {}
    for kind in kinds:
        by_type.setdefault(kind.type, []).append(kind.title)
    return "; ".join(f"{', '.join(titles)} of {name}" for name, titles in by_type.items())


def percent(share: float) -> str:
    """A share in percent, with two digits."""
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"


def share_of(count: int, of: int) -> str:
    """A share in percent; of a few, the count itself."""
    return percent(count / of) if of >= FEW else f"{count} of {of}"


def figures_of(cell: Cell) -> tuple[str, ...]:
    """Cells of a table after degree and number of recordings."""
    if not cell.recordings:
        return ("-",) * 6
    counts = (cell.found, cell.named, cell.named + cell.shared)
    errors = ("-", "-", "-")
    if cell.named:
        covered = share_of(cell.covered, cell.named)
        errors = (f"{cell.error:.3f}", f"{cell.bias:+.3f}", covered)
    return (*(share_of(n, cell.recordings) for n in counts), *errors)
