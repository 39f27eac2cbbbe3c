"""`rulec import mtp`: skeletons of module types, and a map for `rulec watch`, from MTP files."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text
from rulec_runtime.commands.destinations import console, write_json
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import one_line, say_aside, styled
from rulec_runtime.output.write_file import write_text

from rulec.knowledge.read import find_kb
from rulec.mtp.imported import Imported, files_of, import_files, machine_form
from rulec.mtp.knowledge import read_units_and_sensors
from rulec.mtp.limits import MOST_TOLD
from rulec.mtp.refused import MtpRefused, Oddity


def run(options: argparse.Namespace) -> int:
    """Import all files that can be read; exit code 1 if any cannot."""
    target = Path(options.output)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise MtpRefused(f"{target} is not empty; name a new folder")
    knowledge = read_units_and_sensors(find_kb(Path.cwd()))
    modules, refused = import_files([Path(file) for file in options.files], knowledge)
    out = console(options)
    out.print(_table(modules, refused))
    for path, why in refused:
        say_aside(one_line(f"rulec: {why}"))
    for module in modules:
        _tell_odd(out, module)
    if modules:
        for name, text in files_of(modules).items():
            file = target / name
            file.parent.mkdir(parents=True, exist_ok=True)
            write_text(file, text)
        _tell_next(out, modules, target)
    write_json(options, machine_form(modules, refused))
    return 1 if refused else 0


def _table(modules: Sequence[Imported], refused: Sequence[tuple[Path, str]]) -> Table:
    """What was found of what is there, a row per module."""
    table = Table(box=None, padding=(0, 2), pad_edge=False)
    table.add_column("file")
    table.add_column("module")
    for title in ("tags", "units", "nodes", "services", "signals"):
        table.add_column(title, justify="right")
    for module in modules:
        counts = module.counts
        online = f" (+{counts.online} online)" if counts.online else ""
        table.add_row(
            Text(one_line(module.package.file)),
            Text(module.name),
            f"{counts.tags} of {counts.tags_present}",
            f"{counts.units} of {counts.units_present}{online}",
            f"{counts.nodes} of {counts.nodes_present}",
            str(counts.services),
            str(counts.signals),
        )
    for path, _ in refused:
        table.add_row(Text(one_line(path.name)), styled("[red]refused[/]"), *["-"] * 5)
    return table


def _tell_odd(out: Console, module: Imported) -> None:
    """What a person should look at, the first few of each kind."""
    kinds: dict[str, list[Oddity]] = {}
    for oddity in module.odd:
        kinds.setdefault(oddity.kind, []).append(oddity)
    for kind, found in kinds.items():
        out.print(styled("[yellow]{}[/] in {}", kind, module.package.file))
        for oddity in found[:MOST_TOLD]:
            text = f"  {oddity.place}: {oddity.text}; {oddity.remedy}"
            out.print(one_line(text), soft_wrap=True)
        if len(found) > MOST_TOLD:
            out.print(f"  and {len(found) - MOST_TOLD} more of this kind (--json has all)")


def _tell_next(out: Console, modules: Sequence[Imported], target: Path) -> None:
    signals = [r for m in modules for r in m.readings if not r.repeats]
    lacking = sum(bool(r.lacks) for r in signals)
    out.print(
        styled("[green]✓[/] {}", f"{plural(len(modules), 'module', 'modules')} in {target}/modules, "),
        styled("{}", f"nodes in {target}/map.yaml"),
        sep="",
        soft_wrap=True,
    )
    out.print("What to do next:")
    steps = [f"confirm what is marked 'proposal' in {target}/modules: quantities, sensor classes"]
    if lacking:
        left = f"{plural(lacking, 'signal lacks', 'signals lack')} something"
        steps.append(f"fill in what is marked 'TODO': {left}, parameters and observers are missing")
    else:
        steps.append("fill in what is marked 'TODO': parameters, observers and faults")
    if any(m.counts.online for m in modules):
        steps.append("import again with --online where the controllers can be reached: units and "
                     "ranges are read from them")
    steps.append(f"rulec check {target}")
    steps.append("write a plant.yaml that says what feeds what: pipes between modules stand in no MTP")
    for number, step in enumerate(steps, 1):
        out.print(one_line(f"  {number}. {step}"), soft_wrap=True)
