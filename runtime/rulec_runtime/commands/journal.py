"""`journal`: list, filter and export the events of a watched plant; acknowledge an episode."""

import argparse
from typing import Any

from rich.console import Console

from rulec_runtime.commands.destinations import check_outputs, console, write_json, write_to
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.listing import csv_of, json_of, tell
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.live.sources.remarks import extra
from rulec_runtime.output.terminal import styled

FAILED = 3
"""Exit code if an active episode has a status of `--fail-on`."""


def run(options: argparse.Namespace) -> int:
    """List a journal; returns `FAILED` if `--fail-on` applies."""
    extra("sqlalchemy", "journal")
    from rulec_runtime.live.journal.store import open_journal

    check_outputs(options)
    if (options.ack is None) != (options.by is None):
        raise JournalRefused("to take note of an episode give both --ack EPISODE and --by NAME")
    out = console(options)
    journal = open_journal(options.journal, make=False)
    try:
        plants = journal.plants()
        if options.plant is not None and options.plant not in plants:
            text = f"it holds {', '.join(plants)}" if plants else "nothing was reported yet"
            raise JournalRefused(f"{journal.address} holds nothing of {options.plant}; {text}")
        if options.ack is not None:
            _acknowledge(journal, options, plants, out)
        which: dict[str, Any] = {
            "plant": options.plant,
            "kind": options.kind,
            "status": options.status,
        }
        active = list(journal.events(active=True, **which))
        period = {"since": options.since, "until": options.until}
        if options.ack is None:
            limit = limits.LISTED if options.since is None and options.until is None else None
            past = () if options.active else list(journal.events(limit=limit, **period, **which))
            tell(out, active, past, several=len(plants) > 1 and options.plant is None)
        chosen = {"active": options.active, **period, **which}
        if options.csv is not None:
            write_to(options.csv, csv_of(journal.events(**chosen)))
        if options.json is not None:
            write_json(options, json_of(journal.events(**chosen)))
    finally:
        journal.close()
    return FAILED if any(e.event.episode.status in options.fail_on for e in active) else 0


def _acknowledge(
    journal: Any, options: argparse.Namespace, plants: tuple[str, ...], out: Console
) -> None:
    having = [
        plant
        for plant in plants
        if options.plant in (None, plant) and journal.holds(plant, options.ack)
    ]
    if len(having) > 1:
        raise JournalRefused(f"{' and '.join(having)} have an episode {options.ack}: give --plant")
    plant = having[0] if having else options.plant or "any plant"
    new = journal.acknowledge(plant, options.ack, options.by)
    text = "{} of {}: acknowledged" if new else "{} of {}: somebody had acknowledged it before"
    out.print(styled(text, options.ack, plant))
