"""`rulec calibrate`: parameters and curves of a plant, fitted to a fault-free recording."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.console import Console
from rich.table import Table
from rulec_runtime.commands.destinations import console, progress_of, write_json, write_to
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text

from rulec.commands.arguments import Plant, Recorded, folder_of, names_given, recording_given
from rulec.commands.result import AnyPath, Columns, Result, table_of
from rulec.passes.compile_cache import open_plant

if TYPE_CHECKING:
    from rulec.calibration.calibrate import Calibrated
    from rulec.curves.learn import Learnt
    from rulec.language.read_yaml import Document
    from rulec.language.units import Unit


HEADER = "# Written by rulec calibrate. Name it under 'calibration:' in plant.yaml.\n"


@dataclass(frozen=True, kw_only=True)
class CalibrateResult(Result):
    """Fitted parameters with their covariance, and how well estimates agree with true flows.

    Tables: `parameters` and `observers`.
    """

    found: Calibrated

    def __repr__(self) -> str:
        fitted = ", ".join(fit.module for fit in self.found.fits)
        return f"<CalibrateResult {self.found.models.plant.name}: {fitted}>"

    @cached_property
    def _form(self) -> dict[str, Any]:
        from rulec.calibration.calibration_report import calibration_form

        return calibration_form(self.found.models, self.found.fits)

    @property
    def text(self) -> str:
        """The calibration file, YAML."""
        import yaml

        return HEADER + yaml.safe_dump(self._form, sort_keys=False, width=100)

    def to_dict(self) -> dict[str, Any]:
        """The content of the calibration file, and what the recording determined.

        `untold` are the parameters that it left as in the data sheet, `moved` the others, `strain`
        those far from the sheet. `notes` are remarks.
        """
        return {
            **self._form,
            "moved": list(self.found.moved),
            "untold": list(self.found.untold),
            "strain": [{**vars(s), "distance": s.distance} for s in self.found.strain],
            "notes": list(self.found.notes),
        }

    @property
    def unbelievable(self) -> tuple[str, ...]:
        """Parameters too far from their data sheets to be credible."""
        return tuple(strain.parameter for strain in self.found.unbelievable)

    def write(self, file: str | Path, *, force: bool = False) -> None:
        """Write the calibration file, which the plant file names under `calibration`.

        Raises `CalibrationRefused` if a value is not credible, unless `force` is set.
        """
        from rulec.calibration.fit import CalibrationRefused

        if self.unbelievable and not force:
            far = ", ".join(self.unbelievable)
            raise CalibrationRefused(f"{file} not written: {far} too far from the sheet")
        write_text(Path(file), self.text)

    def tell(self, out: Console, name: str | None = None, *, forced: bool = False) -> None:
        """Print how good the calibration is, under a `name` such as that of its file.

        `forced`: it is written although a value is not credible.
        """
        from rulec.calibration.calibration_report import tell

        tell(out, self.found, name or self.found.models.plant.name, forced)

    def _parameters(self) -> Columns:
        rows = [
            (module, name, p["value"], p["u"], p["unit"])
            for module, entry in self._form["modules"].items()
            for name, p in entry["parameters"].items()
        ]
        return table_of(("module", "parameter", "value", "u", "unit"), rows)

    def _observers(self) -> Columns:
        rows = [
            (f"{module}.{name}", o["value"], o["unit"], o["r2"], o["points"], o["set_aside"])
            for module, entry in self._form["modules"].items()
            for name, o in entry.get("misfit", {}).items()
        ]
        return table_of(("observer", "misfit", "unit", "r2", "points", "set_aside"), rows)

    _tables: ClassVar = {"parameters": _parameters, "observers": _observers}


def calibrate(plant: Plant, recording: Recorded) -> CalibrateResult:
    """Fit the parameters of a plant to a fault-free recording with a true flow.

    Parameters
    ----------
    plant : folder with a plant.yaml, or that file.
    recording : path, data frame or mapping of arrays of shape (n,); units as in the titles.

    Raises
    ------
    Refused
        The plant has mistakes.
    RecordingRefused
        This is no recording of the plant.
    CalibrationRefused
        Nothing settled, or no module has a true flow to fit to.

    Examples
    --------
    >>> import rulec
    >>> found = rulec.calibrate("plants/abc", "plants/abc/examples/calibration.csv")
    >>> found.to_frame(backend="pyarrow").column_names
    ['module', 'parameter', 'value', 'u', 'unit']
    """
    opened = open_plant(folder_of(plant))
    (name,) = names_given([recording])
    read = recording_given([recording], opened.ruleset)
    from rulec.calibration.calibrate import calibrated  # loads the compiler

    return CalibrateResult(found=calibrated(opened.models, read, str(name)))


@dataclass(frozen=True, kw_only=True)
class LearnResult(Result):
    """A curve with its band, and the module type that holds it.

    `points` are those of the table, in its `units`; `dropped` are parameters that the type does not
    need any more, and `stated` those of the module that the plant file states.

    Tables: `points`.
    """

    found: Learnt
    recording: str
    units: tuple[Unit, Unit]
    document: Document
    dropped: tuple[str, ...]
    stated: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<LearnResult {self.name}: {len(self.found.knots)} knots>"

    @property
    def name(self) -> str:
        """The learnt definition, such as ``M.opening``."""
        return f"{self.found.module.name}.{self.found.name}"

    def text(self, name: str) -> str:
        """The module type under a new name, YAML."""
        from rulec.curves.fitted_type import type_of

        source = f"{self.found.points} settled points of {self.recording}"
        return type_of(self.document, self.found, self.units, name, source)

    def write(self, file: AnyPath) -> None:
        """Write the module type, named as its file."""
        write_text(Path(file), self.text(Path(file).stem))

    @property
    def points(self) -> list[dict[str, float]]:
        """The knots of the curve with their standard uncertainty."""
        found, (over, unit) = self.found, self.units
        rows = zip(found.knots.tolist(), found.values.tolist(), found.u.tolist(), strict=True)
        return [
            {"at": x / over.factor, "value": y / unit.factor, "u": u / unit.factor}
            for x, y, u in rows
        ]

    def to_dict(self) -> dict[str, Any]:
        """Curve, band, and spans without data; in the units of the table."""
        over, unit = self.units
        return {
            "learnt": self.name,
            "over": self.found.over,
            "in": over.text,
            "unit": unit.text,
            "points": self.points,
            "accuracy": self.found.accuracy,
            "gaps": [[low / over.factor, high / over.factor] for low, high in self.found.gaps],
            "settled": self.found.points,
            "set_aside": self.found.set_aside,
            "dropped": list(self.dropped),
            "notes": list(self.found.sensors),
        }

    def tell(self, out: Console, name: str | None = None) -> None:
        """Print the curve with its band, and the spans without data."""
        over, unit = self.units
        for text in self.found.sensors:
            out.print(f"note: {text}", markup=False)
        table = Table(box=None, padding=(0, 2), pad_edge=False)
        for title in (f"{self.found.over} ({over.text})", f"{self.name} ({unit.text})", "u"):
            table.add_column(title, justify="right")
        for row in self.points:
            table.add_row(f"{row['at']:.4g}", f"{row['value']:.4g}", f"{row['u']:.2g}")
        out.print(table)
        for low, high in self.found.gaps:
            span = f"{low / over.factor:.3g} to {high / over.factor:.3g} {over.text}"
            out.print(f"no data from {span}: a straight line there", markup=False)
        aside = f", {self.found.set_aside} set aside" if self.found.set_aside else ""
        made = f"from {self.found.points} settled points{aside}"
        out.print(styled("[green]✓[/] {}: {}", name or self.name, made), soft_wrap=True)
        if name is not None:
            gone = ", ".join(n for n in self.dropped if n in self.stated)
            more = f", and take out its {gone}" if gone else ""
            text = f"next: in plant.yaml give {self.found.module.name} the type {Path(name).stem}"
            out.print(f"{text}{more}", markup=False, soft_wrap=True)

    def _points(self) -> Columns:
        return {name: [row[name] for row in self.points] for name in ("at", "value", "u")}

    _tables: ClassVar = {"points": _points}


def learn(plant: Plant, recording: Recorded, what: str, *, over: str | None = None) -> LearnResult:
    """Learn a definition of a module as a monotone curve, from ordinary fault-free operation.

    Parameters
    ----------
    plant : folder with a plant.yaml, or that file.
    recording : path, data frame or mapping of arrays of shape (n,); units as in the titles.
    what : the definition, as ``M.opening``.
    over : the signal or definition that it depends on; by default the only input that it reads.

    Raises
    ------
    Refused
        The plant has mistakes.
    RecordingRefused
        This is no recording of the plant.
    CalibrationRefused
        There is no such definition, it depends on something else, too, or no reading determines it.

    Examples
    --------
    >>> import rulec
    >>> found = rulec.learn("plants/rse-boiler", "plants/rse-boiler/examples/day.csv",
    ...                     "boiler.opening")
    >>> found.to_dict()["over"]
    'x'
    """
    opened = open_plant(folder_of(plant))
    (name,) = names_given([recording])
    read = recording_given([recording], opened.ruleset)
    from rulec.curves.fitted_type import dropped, table_units
    from rulec.curves.learn import learn as learnt_of  # loads the compiler, as do these
    from rulec.knowledge.check_dimensions import dimensions_of
    from rulec.language.diagnostics import Refused
    from rulec.language.read_yaml import read_document

    models = opened.models
    found = learnt_of(models, read, str(name), what, over)
    type_, plant_file = found.module.type, opened.sources.plant
    document, mistakes = read_document(Path(type_.file))
    if document is None:
        raise Refused(mistakes)
    assert plant_file is not None
    return LearnResult(
        found=found,
        recording=name.name,
        units=table_units(found, dimensions_of(type_), models.plant.knowledge.units),
        document=document,
        dropped=tuple(dropped(type_, found.name)),
        stated=tuple(plant_file.data["modules"][found.module.name].get("parameters", ())),
    )


def run(options: argparse.Namespace) -> int:
    """Fit, write the calibration file, and show how good it is.

    If a value is not believable, no file is written without `--force`, and the exit code is 1.
    """
    if options.learn is not None:
        return _learn(options)
    if options.over is not None:
        raise Misused("--over says what --learn learns over; give both")
    with progress_of(options, "fitting the modules"):
        found = calibrate(options.plant, options.recording)
    written = options.force or not found.unbelievable
    if written:
        write_to(options.output, found.text)
    write_json(options, found.to_dict())
    found.tell(console(options), options.output, forced=options.force)
    return 0 if written else 1


def _learn(options: argparse.Namespace) -> int:
    """Learn a curve, and write the module type that holds it."""
    with progress_of(options, "learning the curve"):
        found = learn(options.plant, options.recording, options.learn, over=options.over)
    write_to(options.output, found.text(Path(options.output).stem))
    found.tell(console(options), options.output)
    write_json(options, found.to_dict())
    return 0
