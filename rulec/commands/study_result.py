"""The result of `rulec.study`: for the terminal, as a page, and as plain data."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from rich.console import Console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import styled
from rulec_runtime.report import parts as of_study
from rulec_runtime.report.document import Head, document
from rulec_runtime.report.page_origin import made_now
from rulec_runtime.report.parts import Facts, Items, Part, Table, Words
from rulec_runtime.report.subject import Subject

from rulec.commands.result import Columns, PageResult, table_of
from rulec.study.campaign import Settings
from rulec.study.points import Points
from rulec.study.sensors_needed import show_without, without_each
from rulec.study.summary import LEGEND, TITLES, figures_of, per_type, percent, sentences, verdict
from rulec.study.tally import Cell, Tally

COUNTS = ("recordings", "found", "named", "shared", "covered")


@dataclass(frozen=True, kw_only=True)
class StudyResult(PageResult):
    """The outcomes of simulated recordings. `types` are module types by module.

    Tables: `faults` (a row per fault of a module type and degree, with counts of recordings), and
    `confusions` (which fault was taken for which).
    """

    ruleset: Ruleset
    types: Mapping[str, str]
    points: Points
    settings: Settings
    counts: Tally

    def __repr__(self) -> str:
        recordings = sum(cell.recordings for cell in self.counts.cells)
        return f"<StudyResult {self.ruleset.plant}: {recordings} faulty recordings>"

    def to_dict(self) -> dict[str, Any]:
        """The study as `rulec study --json` writes it; readings in SI. The `kinds` of a cell sum up
        to all its recordings."""
        counts, given = self.counts, self.points.given
        return {
            "plant": self.ruleset.plant,
            "ruleset": self.ruleset.sources,
            "settings": asdict(self.settings),
            "points": [
                {name: float(values[i]) for name, values in given.items()}
                for i in range(len(self.points))
            ],
            "faults": [_cell(cell) for cell in counts.cells],
            "confusions": [asdict(confusion) for confusion in counts.confusions],
            "healthy": asdict(counts.healthy),
            "lead_in": asdict(counts.lead_in),
            "without": without_each(self.ruleset),
            "text": list(sentences(counts)),
        }

    def page(self, made: str = "") -> str:
        """The study, one page of HTML; `made` is when and by which tool, by default now."""
        parts = [
            Part("What its diagnosis can do", [Items(list(sentences(self.counts)))]),
            *self._types(Words(LEGEND, soft=True)),
            Part("Where this comes from", [Facts(list(self._facts()))]),
        ]
        head = Head(
            kind="Study of a diagnosis",
            verdict=verdict(self.counts),
            subject=Subject(ruleset=self.ruleset),
            made=made or made_now("rulec"),
        )
        return document(head, parts)

    def tell(self, out: Console) -> None:
        """Print the findings in words, then a table per module type."""
        out.print(styled("\n[bold]{}[/]: what its diagnosis can do\n", self.ruleset.title))
        for sentence in sentences(self.counts):
            out.print(f"- {sentence}")
        if free := self._free:
            out.print(f"- No equation determines {free}: varied like inputs.")
        of_study.tell(out, self._types())
        out.print(styled("[dim]{}[/]", LEGEND))
        show_without(out, self.ruleset, without_each(self.ruleset))

    @property
    def _free(self) -> str:
        """Readings that no equation determines although they are no inputs."""
        signals = self.ruleset.signal_by_id
        return ", ".join(name for name in self.points.given if not signals[name].is_input)

    def _types(self, *legend: Words) -> Iterator[Part]:
        """A table per module type."""
        titles = ("fault", *(f".{title}" for title in TITLES))
        for kind, members, rows in per_type(self.counts, self.types):
            shown = [(cell.fault.title, *_figures(cell)) for row in rows for cell in row]
            name = f"{kind} ({members})"
            yield Part(name, [Table(titles, shown), *legend])

    def _facts(self) -> Iterator[tuple[str, Sequence[str]]]:
        signals, given = self.ruleset.signal_by_id, self.points.given
        yield "recordings", [f"simulated, {self.settings.samples} samples with the fault in each"]
        yield "plants drawn per fault", [str(self.settings.seeds)]
        yield "mode", [self.settings.mode]
        points = (
            (f"{n} {signals[n].shown(float(v[i])):.4g} {signals[n].unit}" for n, v in given.items())
            for i in range(len(self.points))
        )
        yield "operating points", [", ".join(point) for point in points]
        if free := self._free:
            yield "varied like inputs", [f"{free}: no equation determines them"]

    def _faults(self) -> Columns:
        cells = self.to_dict()["faults"]
        names = ("type", "name", "title", "degree", *COUNTS, "error", "bias")
        return {name: [cell[name] for cell in cells] for name in names}

    def _confusions(self) -> Columns:
        rows = [
            (c.fault.type, c.fault.name, c.taken_for.type, c.taken_for.name, c.count, c.of)
            for c in self.counts.confusions
        ]
        names = ("type", "name", "taken for type", "taken for", "count", "of")
        return table_of(names, rows)

    _tables: ClassVar = {"faults": _faults, "confusions": _confusions}


def _cell(cell: Cell) -> dict[str, Any]:
    return {
        **asdict(cell.fault),
        "degree": cell.degree,
        "kinds": {kind.value: count for kind, count in cell.kinds.items()},
        **{name: getattr(cell, name) for name in COUNTS},
        "error": cell.error if cell.named else None,
        "bias": cell.bias if cell.named else None,
    }


def _figures(cell: Cell) -> tuple[str, ...]:
    """A row of a table after the fault."""
    return percent(cell.degree), str(cell.recordings), *figures_of(cell)
