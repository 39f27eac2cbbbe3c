"""`rulec.learn`: a characteristic that no data sheet states, from ordinary operation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.console import Console
from rich.table import Table
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text

from rulec.api.arguments import AnyPath, Plant, Recorded, folder_of, names_given, recording_given
from rulec.api.result import Columns, Result, table_of
from rulec.passes.compile_cache import open_plant

if TYPE_CHECKING:
    from rulec.curves.learn import Learnt
    from rulec.language.document import Document
    from rulec.language.units import Unit


@dataclass(frozen=True, kw_only=True)
class LearnResult(Result):
    """A curve with its band, and the module type that holds it. `stated` are the parameters of the
    module that the plant file states.

    Tables: `points`.
    """

    found: Learnt
    recording: str
    units: tuple[Unit, Unit]
    document: Document
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

    def to_dict(self) -> dict[str, Any]:
        """Curve, band, and spans without data; in the units of the table."""
        over, unit = self.units
        return {
            "learnt": self.name,
            "over": self.found.over,
            "in": over.text,
            "unit": unit.text,
            "points": [
                {"at": x / over.factor, "value": y / unit.factor, "u": u / unit.factor}
                for x, y, u in self._rows
            ],
            "accuracy": self.found.accuracy,
            "gaps": [[low / over.factor, high / over.factor] for low, high in self.found.gaps],
            "settled": self.found.points,
            "set_aside": self.found.set_aside,
            "dropped": list(self._dropped),
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
        for x, y, u in self._rows:
            table.add_row(*(f"{v:.4g}" for v in (x / over.factor, y / unit.factor)),
                          f"{u / unit.factor:.2g}")  # fmt: skip
        out.print(table)
        for low, high in self.found.gaps:
            span = f"{low / over.factor:.3g} to {high / over.factor:.3g} {over.text}"
            out.print(f"no data from {span}: a straight line there", markup=False)
        aside = f", {self.found.set_aside} set aside" if self.found.set_aside else ""
        made = f"from {self.found.points} settled points{aside}"
        out.print(styled("[green]✓[/] {}: {}", name or self.name, made), soft_wrap=True)
        if name is not None:
            gone = ", ".join(n for n in self._dropped if n in self.stated)
            more = f", and take out its {gone}" if gone else ""
            text = f"next: in plant.yaml give {self.found.module.name} the type {Path(name).stem}"
            out.print(f"{text}{more}", markup=False, soft_wrap=True)

    @property
    def _dropped(self) -> list[str]:
        from rulec.curves.fitted_type import dropped

        return dropped(self.found.module.type, self.found.name)

    @property
    def _rows(self) -> list[tuple[float, float, float]]:
        found = self.found
        return list(zip(found.knots.tolist(), found.values.tolist(), found.u.tolist(), strict=True))

    def _points(self) -> Columns:
        rows = [tuple(row.values()) for row in self.to_dict()["points"]]
        return table_of(("at", "value", "u"), rows)

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
    from rulec.knowledge.check_dimensions import dimensions_of
    from rulec.language.diagnostics import Refused
    from rulec.language.document import read_document

    opened = open_plant(folder_of(plant))
    (name,) = names_given([recording])
    read = recording_given([recording], opened.ruleset)
    from rulec.curves.fitted_type import table_units
    from rulec.curves.learn import learn as learnt_of  # loads the compiler

    models = opened.models
    found = learnt_of(models, read, str(name), what, over)
    type_ = found.module.type
    document, mistakes = read_document(Path(type_.file))
    if document is None:
        raise Refused(mistakes)
    units = table_units(found, dimensions_of(type_), models.plant.knowledge.units)
    plant_file = opened.sources.plant
    assert plant_file is not None
    stated = tuple(plant_file.data["modules"][found.module.name].get("parameters", ()))
    return LearnResult(
        found=found, recording=name.name, units=units, document=document, stated=stated
    )
