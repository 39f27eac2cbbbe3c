"""`rulec demo --live`: a whole plant on one machine, and the faults found in it."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources.refused import SourceRefused
from rulec_runtime.output.refusal import to_install
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text

from rulec.api.simulate import parse_fault, simulate
from rulec.demo import limits
from rulec.demo.compare import matched, tell
from rulec.demo.played_recording import free_port, planted, write_inputs
from rulec.demo.processes import servers, watch, write_map
from rulec.passes.compile_cache import ruleset_of_plant
from rulec.simulation.prediction import Injected


def run_live(options: argparse.Namespace, plant: Path, out: Console) -> int:
    """Let servers of all modules play a simulated recording, and `rulec watch` find its faults."""
    for package in ("asyncua", "sqlalchemy", "starlette", "uvicorn"):
        if find_spec(package) is None:
            raise SourceRefused(f"demo --live needs '{package}': {to_install('watch', 'rulec')}")
    if not 0 < options.speed <= limits.FASTEST:
        raise SourceRefused(f"--speed {options.speed:g}: give a number up to {limits.FASTEST:g}")
    with tempfile.TemporaryDirectory(prefix="rulec-demo-") as folder:
        place = Path(folder)
        ruleset, faults = _made(place, plant, out)
        began = _watched(place, ruleset, 1 / options.speed, out)
        out.rule("3. what the journal says, against what was planted")
        if began is None:
            out.print("the watch ended before the first row")
            return 1
        _compared(place, ruleset, faults, began, 1 / options.speed, out)
    return 0


def _made(place: Path, plant: Path, out: Console) -> tuple[Ruleset, list[Injected]]:
    """Write the ruleset and the recording to play as files; returns the ruleset and the faults."""
    out.rule("1. simulate: a recording with faults, which the modules' servers play")
    texts = planted()
    out.print("$ rulec simulate abc.json inputs.csv -o played.csv --noise 1 \\")
    for text in texts:
        out.print(f"    --fault {text}" + (" \\" if text != texts[-1] else ""))
    ruleset = ruleset_of_plant(plant)
    write_text(place / "abc.json", ruleset.to_json())
    write_inputs(plant / "examples", place / "inputs.csv")
    faults = [parse_fault(text) for text in texts]
    played = simulate(place / "abc.json", place / "inputs.csv", faults=faults, noise=limits.NOISE)
    played.write(place / "played.csv")
    return ruleset, faults


def _watched(place: Path, ruleset: Ruleset, step: float, out: Console) -> float | None:
    """Play to the end, or until the watch ends; returns the time of the first row, s since 1970."""
    out.rule("2. watch: one OPC UA server per module, and the diagnosis beside them")
    with ExitStack() as stack:
        playing = stack.enter_context(servers(place / "played.csv", step))
        endpoints = playing.wait_for("servers", limits.STARTING)
        names = [s.id for s in ruleset.signals if s.id in ruleset.read]
        write_map(place / "map.yaml", endpoints, names, step)
        for module, endpoint in endpoints.items():
            out.print(styled("module {}: {}", module, endpoint))
        port = free_port()
        arguments = ["--map", "map.yaml", "--journal", "journal.db", "--page", str(port)]
        first, second = " ".join(arguments[:2]), " ".join(arguments[2:])
        out.print(f"$ rulec watch abc.json --source opcua {first} \\\n    {second}")
        out.print(styled("[bold]the page: http://127.0.0.1:{}/[/]", port))
        out.print(f"{limits.ROWS * step:.0f} s; Ctrl-C, or q on a terminal, ends it")
        if out.is_terminal:
            time.sleep(limits.READ_FIRST)
        watching = stack.enter_context(watch(place, ["abc.json", "--source", "opcua", *arguments]))
        began = None
        with suppress(KeyboardInterrupt):
            began = playing.wait_for("began", limits.STARTING, watching)
            if began is not None:
                playing.wait_for("ended", limits.ROWS * step + limits.STARTING, watching)
        return began


def _compared(
    place: Path,
    ruleset: Ruleset,
    faults: Sequence[Injected],
    began: float,
    step: float,
    out: Console,
) -> None:
    from rulec_runtime.live.journal.store import open_journal

    with closing(open_journal(str(place / "journal.db"), make=False)) as journal:
        events = [entry.event for entry in journal.events(ruleset.plant)]
    played = [
        replace(f, since=began + f.since * step, until=began + f.until * step) for f in faults
    ]
    matches, others = matched(played, events)
    tell(out, matches, others, began)
