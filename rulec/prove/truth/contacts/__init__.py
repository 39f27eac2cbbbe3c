"""First contacts: a plant with a data sheet, and one recording of ordinary operation.

In half of the plants, one law has another standard form than in the module type. True values are
within the uncertainty of the sheet, laws within their accuracy, sensors within their class. It
shares no code with the packages it tests; module types are the YAML files here, and numbers are in
their units.
"""

from __future__ import annotations

import functools
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..formulas import Names
from ..recording import write_csv
from ..sealed import Answer, Planted
from ..sensors import Sensing, Sensor, read
from ..settled import drive
from ..smooth import form_error
from ..streams import factor, stream
from ..units import ZERO_CELSIUS, Array

MODULE = "unit"
CASES, QUICK = 40, 10
SAMPLES, PACE = 400, 10.0
PART = 0.5, 0.9
"""Least and largest used part of the range of each setting."""

FLOW, WARM = 10.0, 30.0
"""m3/h and degC at which laws of another form agree with the ordinary ones."""

PROFILES = "steps", "ramps", "long-constant"

Numbers = Mapping[str, float]
Arrays = Mapping[str, Array]


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A law that may have another form; see `kinds.yaml`.

    Attributes
    ----------
    type : the module type of its plants
    ranges : of each setting
    arguments : of each law, by its name in the module type
    """

    type: str
    ranges: Mapping[str, tuple[float, float]]
    arguments: Mapping[str, Sequence[str]]
    form: Mapping[str, tuple[float, float]]
    ordinary: Numbers
    laws: Mapping[str, str]
    outputs: Sequence[str]
    names: Sequence[str]
    places: Sequence[str]

    def law(self, p: Numbers, x: Arrays, off: Arrays, form: Numbers) -> dict[str, Array]:
        """Return true outputs by parameters, true inputs, law errors as factors, and sizes of
        another form."""
        given = {**p, **x, **off, **self.ordinary, **form}
        names = Names(None, {"FLOW": FLOW, "WARM": WARM}, None, **given)
        names.fix(self.laws)
        return {name: names[name] for name in self.outputs}

    @property
    def file(self) -> Path:
        """The file of the module type."""
        return Path(__file__).with_name(f"{self.type}.yaml")

    @functools.cached_property
    def stated(self) -> Mapping[str, Any]:
        """The module type."""
        found: Mapping[str, Any] = yaml.safe_load(self.file.read_text(encoding="utf-8"))
        return found

    @functools.cached_property
    def sensors(self) -> Mapping[str, Sensor]:
        """The sensors by signal."""
        found = {}
        for name, signal in self.stated["signals"].items():
            bound, of = CLASSES[signal["sensor"]]
            bound *= signal["range"][1] if of == "full scale" else 1.0
            found[name] = Sensor(signal["unit"], 1.0, bound, relative=of == "reading")
        return found


_TABLE = yaml.safe_load(Path(__file__).with_name("kinds.yaml").read_text(encoding="utf-8"))

CLASSES: Mapping[str, tuple[float, str]] = {n: (b, of) for n, (b, of) in _TABLE["classes"].items()}

KINDS: Mapping[str, Kind] = {name: Kind(**stated) for name, stated in _TABLE["kinds"].items()}
"""In the order of the issue that asked for them."""


@dataclass(frozen=True)
class Planned:
    """A first contact to be made; the same seed gives the same bytes."""

    seed: int
    kind: str
    other: bool

    @property
    def name(self) -> str:
        """Unique in a run."""
        return f"contact-{self.seed:02d}-{self.kind}{'' if self.other else '-sound'}"

    def make(self) -> Contact:
        """Draw sheet, truth and operation."""
        kind, random = KINDS[self.kind], stream(self.seed, "contact")
        sheet, true = {}, {}
        for name, stated in kind.stated["parameters"].items():
            value = stated["value"]
            if stated["u"]:
                scaled = value * float(random.uniform(0.8, 1.25))
                sheet[name] = float(f"{scaled:.4g}"), float(f"{stated['u'] * scaled / value:.3g}")
                value = sheet[name][0] * factor(sheet[name][1] / sheet[name][0], random)
            true[name] = value
        forms = {}
        for law, by in kind.arguments.items():
            accuracy = float(kind.stated["definitions"][law]["accuracy"].partition("%")[0]) / 100.0
            forms[law] = form_error(random, 0.5 * accuracy, tuple(kind.ranges[a] for a in by))
        # Drawn for a sound plant too, so that both have the same operation.
        form = {name: float(random.uniform(*ends)) for name, ends in kind.form.items()}
        form = form if self.other else {}
        given = _operated(kind, random)
        off = {law: 1.0 + forms[law](*(given[a] for a in kind.arguments[law])) for law in forms}
        planted = Planted(
            effect=self.kind,
            title=self.kind,
            sort="physics",
            module=MODULE,
            place=kind.places[0],
            names=tuple(kind.names),
            places=tuple(f"{MODULE}.{place}" for place in kind.places),
            parameters={},
            gain=float("nan"),
        )
        answer = Answer(
            case=self.name,
            half="stationary",
            plant=kind.type,
            profile="ordinary",
            seed=self.seed,
            samples=SAMPLES,
            verdict="named" if self.other else "none",
            effects=(planted,) * self.other,
        )
        return Contact(kind, sheet, answer, true, {**given, **kind.law(true, given, off, form)})


@dataclass(frozen=True)
class Contact:
    """A first contact; `sheet` has value and u of each parameter, `values` and `true` are true
    parameters and signals."""

    kind: Kind
    sheet: Mapping[str, tuple[float, float]]
    answer: Answer
    values: Numbers
    true: Arrays = field(repr=False)

    def write(self, folder: Path) -> None:
        """Write `plant/`, with the module type in its own knowledge, and `recording.csv`."""
        modules = folder / "plant" / "kb" / "modules"
        modules.mkdir(parents=True, exist_ok=True)
        shutil.copy(self.kind.file, modules)
        lines = ["plant: contact", "title: A plant from its data sheet", "modules:"]
        lines += [f"  {MODULE}:", f"    type: {self.kind.type}", "    parameters:"]
        for name, (value, u) in self.sheet.items():
            unit = self.kind.stated["parameters"][name]["unit"]
            stated = f"value: {value!r}, unit: {unit}, u: {u!r}, source: data sheet"
            lines.append(f"      {name}: {{{stated}}}")
        plant = folder / "plant" / "plant.yaml"
        plant.write_text("\n".join(lines) + "\n", encoding="utf-8")
        columns: dict[str, Array] = {"time [s]": PACE * np.arange(SAMPLES, dtype=np.float64)}
        sensing = Sensing(law="truncated")
        for name, sensor in self.kind.sensors.items():
            place = f"{MODULE}.{name}"
            shown = read(sensor, place, self.true[name], sensing, self.answer.seed)
            columns[f"{place} [{sensor.unit}]"] = shown
        write_csv(folder / "recording.csv", columns)


def planned(first: int, count: int = CASES) -> Iterator[Planned]:
    """Yield cases of the seeds from `first` on: each kind in turn, sound, then of another form."""
    for seed in range(first, first + count):
        yield Planned(seed, list(KINDS)[(seed - 1) // 2 % len(KINDS)], seed % 2 == 0)


def _operated(kind: Kind, random: np.random.Generator) -> dict[str, Array]:
    """Ordinary operation: each setting in a part of its range; slow temperatures."""
    given = {}
    for name, (low, high) in kind.ranges.items():
        part = float(random.uniform(*PART))
        share = part * drive.course(random, PROFILES[int(random.integers(len(PROFILES)))], SAMPLES)
        given[name] = low + (high - low) * (share + float(random.uniform(0.0, 1.0 - part)))
    if "T" in kind.sensors:
        given["T"] = drive.temperature(random, SAMPLES) - ZERO_CELSIUS
    return given
