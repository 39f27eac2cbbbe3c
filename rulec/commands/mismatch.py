"""`rulec mismatch`: report where simulation and recording differ, and which physics is left out."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from rulec_runtime.commands.destinations import (
    STANDARD_OUTPUT,
    check_outputs,
    console,
    progress_of,
    show_files,
    write_json,
    write_to,
)
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.write_file import write_text

from rulec.api.arguments import folder_of
from rulec.api.mismatch import MismatchResult, Periods, mismatch
from rulec.limits import UNSURE
from rulec.mismatch.answer.json_form import hidden_csv


def run(options: argparse.Namespace) -> int:
    """Compare. A mismatch is a result, so the exit code is 0; for the verdict `unsure` it is
    `UNSURE`, as a script must not take that for sound."""
    heldout = periods_of(options.heldout)
    folder_of(options.plant)
    check_outputs(options)
    with progress_of(options, "reading the plant") as progress:
        found = mismatch(
            options.plant,
            options.recording,
            heldout=heldout,
            power=options.power,
            progress=progress,
        )
    # All files first: whatever reads the story may go before its end.
    if options.report:
        write_to(options.report, found.page())
    if options.series:
        write_to(options.series, found.series_csv())
    hidden = _write_hidden(options, found)
    write_json(options, found.form(hidden.name if hidden else None))
    out = console(options)
    found.tell(out)
    courses = {"courses of the models": options.series, "course of what is not recorded": hidden}
    show_files(out, {"report": options.report, **courses})
    return UNSURE if found.verdict == "unsure" else 0


def periods_of(texts: Sequence[str]) -> Periods:
    """Held-out periods, s; raises `Misused` for a bad one.

    >>> periods_of(["0:60", "120:180.5"])
    ((0.0, 60.0), (120.0, 180.5))
    """
    periods = []
    for text in texts:
        parts = text.split(":")
        try:
            since, until = (float(part) for part in parts)
        except ValueError:
            since = until = math.nan
        if not (math.isfinite(since) and math.isfinite(until)):
            raise Misused(
                f"--heldout {text}: give two numbers of seconds with a colon between, as in 600:900"
            )
        if not since < until:
            raise Misused(
                f"--heldout {text}: it ends before it begins; did you mean {parts[1]}:{parts[0]}?"
                if until < since
                else f"--heldout {text}: it has no length"
            )
        periods.append((since, until))
    return tuple(periods)


def _write_hidden(options: argparse.Namespace, found: MismatchResult) -> Path | None:
    """Write the course of a hidden driver beside the JSON file; returns its file."""
    hidden = found.found.hidden
    if hidden is None or options.json in (None, STANDARD_OUTPUT):
        return None
    target = Path(options.json)
    series = target.with_name(f"{target.stem}.hidden.csv")
    write_text(series, hidden_csv(hidden))
    return series
