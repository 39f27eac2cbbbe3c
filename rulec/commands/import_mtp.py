"""`rulec import mtp`: skeletons of module types, and a map for `rulec watch`, from MTP files."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text
from rulec_runtime.commands.destinations import console, write_json
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import one_line, say_aside, styled
from rulec_runtime.output.write_file import write_text

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.read import read_around
from rulec.mtp.imported import Imported, files_of, import_files, json_form
from rulec.mtp.limits import MOST_SHOWN
from rulec.mtp.package import MtpRefused, Oddity


def run(options: argparse.Namespace) -> int:
    """Import all files that can be read; the exit code is 1 if any cannot."""
    target = Path(options.output)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise MtpRefused(f"{target} is not empty; name a new folder")
    knowledge = check_knowledge(read_around(Path()))
    files = [Path(file) for file in options.files]
    if options.online and len(files) > 1:
        raise MtpRefused("--online with an address is for one file; each module has its own server")
    modules, refused = import_files(files, knowledge, options.online)
    for name, text in files_of(modules).items() if modules else ():
        file = target / name
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, text)
    write_json(options, json_form(modules, refused))
    out = console(options)
    out.print(_table(modules, refused))
    for _, why in refused:
        say_aside(one_line(f"rulec: {why}"))
    for module in modules:
        _tell_odd(out, module)
    if modules:
        count = plural(len(modules), "module", "modules")
        where = f"{count} in {target}/modules, their nodes in {target}/map.yaml"
        out.print(styled("[green]✓[/] {}", where), soft_wrap=True)
        out.print("What to do next:")
        for number, step in enumerate(_steps(modules, target), 1):
            out.print(Padding(one_line(f"{number}. {step}"), (0, 0, 0, 2)))
    return 1 if refused else 0


def _table(modules: Sequence[Imported], refused: Sequence[tuple[Path, str]]) -> Table:
    """How much was imported, a row per module."""
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    table.add_column("file", overflow="fold")
    for title in ("tags", "units", "online", "nodes", "services", "signals"):
        table.add_column(title, justify="right", no_wrap=True)
    for module in modules:
        counts = module.counts
        table.add_row(
            Text(one_line(module.package.file)),
            f"{counts['tags']} of {counts['tags_present']}",
            f"{counts['units']} of {counts['units_present']}",
            f"+{counts['online']}" if counts["online"] else "",
            f"{counts['nodes']} of {counts['nodes_present']}",
            str(counts["services"]),
            str(counts["signals"]),
        )
    for path, _ in refused:
        table.add_row(Text(one_line(path.name)), styled("[red]refused[/]"), *["-"] * 5)
    return table


def _tell_odd(out: Console, module: Imported) -> None:
    """Print the first few oddities of each kind, which a person should check."""
    kinds: dict[str, list[Oddity]] = {}
    for oddity in module.odd:
        kinds.setdefault(oddity.kind, []).append(oddity)
    for kind, found in kinds.items():
        out.print(styled("[yellow]{}[/] in {}", kind, module.package.file))
        for oddity in found[:MOST_SHOWN]:
            text = f"  {oddity.place}: {oddity.text}; {oddity.remedy}"
            out.print(one_line(text), soft_wrap=True)
        if len(found) > MOST_SHOWN:
            out.print(f"  and {len(found) - MOST_SHOWN} more of this kind (--json has all)")


def _steps(modules: Sequence[Imported], target: Path) -> Iterator[str]:
    lacking = sum(bool(r.lacks) for m in modules for r in m.readings if not r.repeats)
    if any(m.counts["online"] for m in modules):
        yield (
            "where the controllers can be reached, import again with --online: units and ranges "
            "are read from them"
        )
    yield f"confirm what is marked 'proposal' in {target}/modules: quantities and sensor classes"
    left = f"{plural(lacking, 'signal lacks', 'signals lack')} something; " if lacking else ""
    yield f"fill in what is marked 'TODO': {left}an MTP holds no parameters, observers or faults"
    yield f"rulec check {target}"
    yield "write a plant.yaml that says what feeds what: an MTP does not describe pipes"
