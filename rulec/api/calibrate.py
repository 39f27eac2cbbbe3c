"""`rulec.calibrate`: parameters of a plant fitted to a fault-free recording."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.console import Console
from rulec_runtime.output.write_file import write_text

from rulec.api.arguments import Plant, Recorded, folder_of, names_given, recording_given
from rulec.api.result import Columns, Result, table_of
from rulec.passes.compile_cache import open_plant

if TYPE_CHECKING:
    from rulec.calibration.calibrate import Calibrated

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
