"""`rulec demo`: the main job on a shipped example, end to end."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from threading import Thread
from typing import Any

from rich.console import Console
from rulec_runtime.commands.destinations import console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.live.sources.remarks import SourceRefused
from rulec_runtime.output.refusal import to_install
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.report.terminal_findings import explain

from rulec.commands.matrix import show
from rulec.commands.simulate import simulate
from rulec.demo import limits
from rulec.demo.played_recording import free_port, planted, write_inputs
from rulec.knowledge.layers import shipped
from rulec.passes.compile_cache import ruleset_of_plant


def run(options: argparse.Namespace) -> int:
    """Compile the shipped plant, show its matrix, diagnose a recording made with a fault."""
    out = console(options)
    plant = shipped("plants") / "abc"
    if plant.is_relative_to(Path.cwd()):
        plant = plant.relative_to(Path.cwd())
    if options.live:
        return run_live(options, plant, out)
    truth = min((plant / "examples").glob("*.truth.csv"))
    recording = truth.with_name(truth.name.replace(".truth", ""))
    out.rule("1. compile: from module files to a fault-symptom matrix")
    out.print(f"$ rulec matrix {plant}")
    ruleset = ruleset_of_plant(plant)
    show(out, ruleset)
    out.rule("2. diagnose: a simulated recording with a fault that grows in steps")
    out.print(f"$ rulec diagnose {plant} {recording}")
    explain(out, diagnose(read_recording(recording, ruleset), ruleset))
    return 0


def run_live(options: argparse.Namespace, plant: Path, out: Console) -> int:
    """Let servers of all modules play a simulated recording, and `rulec watch` find its faults."""
    for package in ("asyncua", "sqlalchemy", "starlette", "uvicorn"):
        if find_spec(package) is None:
            raise SourceRefused(f"demo --live needs '{package}': {to_install('watch', 'rulec')}")
    if not 0 < options.speed <= limits.FASTEST:
        raise SourceRefused(f"--speed {options.speed:g}: give a number up to {limits.FASTEST:g}")
    with tempfile.TemporaryDirectory(prefix="rulec-demo-") as folder:
        place = Path(folder)
        ruleset = _made(place, plant, out)
        _watched(place, ruleset, 1 / options.speed, out)
        _list_journal(place / "journal.db", out)
    return 0


def _made(place: Path, plant: Path, out: Console) -> Ruleset:
    """Write the ruleset and the recording to play as files; returns the ruleset."""
    out.rule("1. simulate: a recording with faults, which the modules' servers play")
    texts = planted()
    out.print("$ rulec simulate abc.json inputs.csv -o played.csv --noise 1 \\")
    for text in texts:
        out.print(f"    --fault {text}" + (" \\" if text != texts[-1] else ""))
    ruleset = ruleset_of_plant(plant)
    write_text(place / "abc.json", ruleset.to_json())
    write_inputs(plant / "examples", place / "inputs.csv")
    played = simulate(place / "abc.json", place / "inputs.csv", faults=texts, noise=limits.NOISE)
    played.write(place / "played.csv")
    return ruleset


def _watched(place: Path, ruleset: Ruleset, step: float, out: Console) -> None:
    """Play to the end, or until the watch ends. Raises `SourceRefused` if no server starts."""
    out.rule("2. watch: one OPC UA server per module, and the diagnosis beside them")
    with servers(place / "played.csv", step) as playing:
        if not (message := _next_message(playing)):
            raise SourceRefused("the servers of the demo ended; is there no loopback?")
        endpoints = message["servers"]
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
        options = ["abc.json", "--source", "opcua", *arguments]
        with watch(place, options) as watching, suppress(KeyboardInterrupt):
            Thread(target=_interrupt_at_end, args=(playing, watching), daemon=True).start()
            watching.wait()


def _list_journal(file: Path, out: Console) -> None:
    """Print what the watch wrote, as `rulec journal` does."""
    from rulec_runtime.live.journal.listing import tell
    from rulec_runtime.live.journal.store import open_journal

    out.rule("3. the journal: what began, grew and ended")
    out.print("$ rulec journal journal.db")
    with closing(open_journal(str(file), make=False)) as journal:
        tell(out, list(journal.events(active=True)), list(journal.events()), several=False)


Process = subprocess.Popen[Any]


def _next_message(playing: Process) -> dict[str, Any]:
    """What the servers say next; empty if they have ended."""
    assert playing.stdout is not None
    return dict(json.loads(playing.stdout.readline() or "{}"))


def _interrupt_at_end(playing: Process, watching: Process) -> None:
    """Interrupt the watch as soon as the recording has ended, or the servers have."""
    _next_message(playing)
    _interrupt(watching)


def _interrupt(process: Process) -> None:
    """SIGTERM, which `rulec watch` takes as Ctrl-C: what a shell starts in the background, as a job
    of CI may be, ignores an interrupt. Nothing happens if the process has ended."""
    process.terminate()


@contextmanager
def servers(recording: Path, step: float) -> Iterator[Process]:
    """Servers that play a recording, a row every `step` s, as soon as a client has subscribed."""
    process = subprocess.Popen(
        [sys.executable, "-m", "rulec.demo.servers", str(recording), str(step)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        assert process.stdin is not None
        process.stdin.close()
        _ended(process)


@contextmanager
def watch(folder: Path, options: Sequence[str]) -> Iterator[Process]:
    """`rulec watch` in a folder, on our terminal; interrupted at the end as by Ctrl-C."""
    process = subprocess.Popen([sys.executable, "-m", "rulec", "watch", *options], cwd=folder)
    try:
        yield process
    finally:
        _interrupt(process)
        _ended(process)


def _ended(process: Process) -> None:
    try:
        process.wait(limits.ENDING)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def write_map(
    target: Path, endpoints: Mapping[str, str], signals: Sequence[str], step: float
) -> None:
    """Write the node of each signal: ``M.x`` is ``ns=2;s=x`` of the server of M. JSON is YAML."""
    data = {
        "interval": step,
        "servers": {module: {"endpoint": endpoint} for module, endpoint in endpoints.items()},
        "signals": {name: f"ns=2;s={name.partition('.')[2]}" for name in signals},
    }
    write_text(target, json.dumps(data, indent=1) + "\n")
