"""A run in the terminal and as a page: goals, worst cases, how it was measured."""

from collections.abc import Sequence

from rich.console import Console
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.document import Head, document, facts, section
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.text import counted, number

from rulec.prove.results import Run
from rulec.prove.scores import Row, table
from rulec.prove.second_round_table import tables_of_rounds
from rulec.prove.tables import SYMBOLS, Table, sections, tables, tell


def show(out: Console, run: Run) -> None:
    """Print the scores and the worst cases."""
    out.print(styled("[bold]{}[/]", headline(run, table(run.judged))))
    out.print(styled("[dim]{}[/]\n", partition_words(run)))
    tell(out, _tables(run))


def page(run: Run, made: Made | None = None) -> str:
    """Write the page; the same run gives the same text."""
    rows = table(run.judged)
    good = all(row.met for row in rows)
    measured = section("How this was measured", f'<div class="facts">{_measured(run)}</div>')
    head = Head(
        kind="Proof on concealed effects",
        verdict=headline(run, rows),
        meaning=partition_words(run),
        badge=f'<span class="badge is-{"ok" if good else "F"}">{SYMBOLS[good]}</span>',
        made=made,
    )
    return document(head, sections(_tables(run), "Scores and their goals") + measured)


def _tables(run: Run) -> list[Table]:
    further = tables_of_rounds(run.judged, run.further) if run.further else ()
    return [*tables(run.judged), *further]


def headline(run: Run, rows: Sequence[Row]) -> str:
    """Return in a sentence how many goals are met, on how many cases."""
    met, judged = (sum(r.met is value for r in rows) for value in (True, None))
    words = f"{met} of {len(rows)} scores reach their goal"
    if judged:
        words += f", {judged} without a case"
    return f"{words}, on {counted(len(run.judged), f'{run.partition} case')}"


def partition_words(run: Run) -> str:
    """Return in a sentence what the partition proves."""
    if not run.judged:
        return "No case was judged."
    if run.partition == "final":
        return f"The final cases were opened {counted(run.openings, 'time')}, this one included."
    return "The tool was improved on these very cases: they prove nothing yet."


def _measured(run: Run) -> str:
    judged = run.judged
    failed = sum(bool(j.error) for j in judged)
    seconds = sum(j.seconds for j in judged)
    each = f"; {number(seconds / len(judged), 2)} s a case" if judged else ""
    clean = sum(j.clean for j in judged)
    return facts(
        [
            ("Partition", [f"{run.partition}: {partition_words(run)}"]),
            ("Cases", [f"{len(judged)}, {clean} of them clean; {failed} without an answer"]),
            ("Seed", [str(run.seed)]),
            ("Openings of the final cases", [str(run.openings)]),
            ("Hash of the sealed answers", [run.digest] if run.digest else []),
            ("Version of the tool", [run.version] if run.version else []),
            ("Time", [f"{number(run.seconds, 3)} s by the clock{each}"]),
            ("Remarks", list(run.notes)),
        ]
    )
