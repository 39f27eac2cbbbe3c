"""`rulec import curve`: the law of a module type fitted to the points of a maker's sheet."""

import argparse
import re
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rulec_runtime.commands.destinations import check_outputs, console, write_json, write_to
from rulec_runtime.output.terminal import one_line, styled

from rulec.curves.fit import Compared, FittedCurve, fit_curve
from rulec.curves.fitted_type import form_of, module_of
from rulec.curves.match import given_values, points_of
from rulec.curves.sheet import CurveRefused, columns_of, grade_of
from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.read import read_type

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,60}")


def run(options: argparse.Namespace) -> int:
    """Fit, report how well the law holds, write the module type.

    If the law leaves the tolerance, no file is written without `--force`, and the exit code is 1.
    """
    check_outputs(options)
    file, target = Path(options.file), Path(options.output)
    name = options.name or target.stem
    if not _NAME.fullmatch(name):
        hint = "a letter, then at most 60 letters, digits, _ and -; give --name"
        raise CurveRefused(f"'{name[:70]}' is not a legal name of a module type: {hint}")
    document, sources = read_type(options.type, Path())
    knowledge = check_knowledge(sources)
    kind = knowledge.modules[options.type]
    grade = None if options.grade is None else grade_of(options.grade)
    signals, parameters = given_values(options.at, kind, knowledge.units)
    columns = columns_of(file, knowledge.units, kind.signals, options.columns)
    fitted = fit_curve(kind, points_of(kind, columns, signals), parameters, grade)
    source = one_line(options.source or file.name)
    written = options.force or fitted.holds
    if written:
        write_to(options.output, module_of(document, fitted, name, source))
    write_json(options, json_form(fitted, source))
    _tell(console(options), fitted, options.output, written)
    return 0 if written else 1


def _tell(out: Console, fitted: FittedCurve, target: str, written: bool) -> None:
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    for title in ("law", "gives", "points", "off by", "at most", "at", "tolerance"):
        table.add_column(title, justify="left" if title in ("law", "gives") else "right")
    for one in fitted.laws:
        shares = [f"{100 * share:.2g} %" for share in (one.scatter, one.largest)]
        row = (one.law.name, one.reading, str(one.points), *shares, _place(fitted, one))
        table.add_row(*row, f"{100 * one.tolerance.share:g} %")
    out.print(table)
    for note in fitted.points.notes:
        out.print(styled("[dim]note: {}[/]", note))
    if fitted.untold:
        names = ", ".join(fitted.untold)
        out.print(styled("[dim]as in the type, the sheet says nothing of it: {}[/]", names))
    if not written:
        far = ", ".join(one.law.name for one in fitted.laws if not one.holds)
        text = f"{target} not written: {far} leaves the tolerance. Are two columns swapped, or the "
        text += "unit another one? Else the law is not that of this device; --force writes it"
        out.print(styled("[red]✗[/] {}", text))
        return
    out.print(styled("[green]✓[/] {}", target), soft_wrap=True)
    out.print(styled("next: rulec check {}", target), soft_wrap=True)


def _place(fitted: FittedCurve, one: Compared) -> str:
    """Where the error of a law is largest, in the unit of the type."""
    signal = fitted.kind.signals.get(one.reading)
    if signal is None:
        return f"{3600 * one.at:.3g} m3/h"
    return f"{signal.unit.from_si(one.at):.3g} {signal.unit.text}"


def json_form(fitted: FittedCurve, source: str) -> dict[str, Any]:
    """The result as JSON data; parameters in the units of the type."""
    parameters = fitted.kind.parameters
    return {
        "type": fitted.kind.name,
        "source": source,
        "parameters": {
            name: {"value": parameters[name].unit.from_si(v), "unit": parameters[name].unit.text}
            for name, v in fitted.parameters.items()
        },
        "untold": list(fitted.untold),
        "notes": list(fitted.points.notes),
        "laws": [
            {
                "law": one.law.name,
                "reading": one.reading,
                "points": one.points,
                "scatter": one.scatter,
                "largest": one.largest,
                "tolerance": one.tolerance.share,
                "u": one.u,
                "accuracy": form_of(one).text,
                "holds": one.holds,
            }
            for one in fitted.laws
        ],
    }
