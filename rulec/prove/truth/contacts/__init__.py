"""First contacts: a plant with a data sheet, and one recording of ordinary operation.

Half of the plants have one law of another standard form than their module type says. True values
lie within the uncertainty of the sheet, laws keep to their accuracy, sensors to their class. Shares
no code with the packages it tests. A folder holds `plant/` with the module type in it (of the YAML
files here), and `recording.csv`. Numbers are in the units of the module types.
"""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..drawn import factor
from ..recording import write_csv
from ..sealed import Answer, Planted, Reference, Request, verdict_of
from ..sensors import Sensing, Sensor, read
from ..settled import drive
from ..smooth import form_error
from ..streams import stream
from ..units import ZERO_CELSIUS, Array

MODULE = "unit"
CASES, QUICK = 40, 10
SAMPLES, PACE = 400, 10.0
PART = 0.5, 0.9
"""Part of the range of each setting that is used."""

FLOW, WARM = 10.0, 30.0
"""m3/h and degC at which laws of another form agree with the ordinary ones."""

SENSING = Sensing(law="truncated")
PROFILES = drive.steps, drive.ramps, drive.long_constant

Numbers = Mapping[str, float]
Arrays = Mapping[str, Array]
Law = Callable[[Numbers, Arrays, Arrays, Numbers], dict[str, Array]]
"""(parameters, true inputs, law errors as factors, sizes of another form) -> true outputs."""


def _pump(p: Numbers, x: Arrays, off: Arrays, form: Numbers) -> dict[str, Array]:
    """Affinity laws. Source: Guelich, Centrifugal Pumps."""
    nu = x["n"] / p["n0"]
    fall = p["h2"] * (nu * FLOW) ** 2 * (x["Q"] / (nu * FLOW)) ** form.get("m", 2.0)
    head = (nu**2 * p["h0"] - fall) * off["dp_law"]
    power = nu**3 * p["p0"] + nu**2 * p["p1"] * x["Q"]
    return {"dp": head, "P_el": power * off["P_law"] + form.get("c", 0.0)}


def _valve(p: Numbers, x: Arrays, off: Arrays, form: Numbers) -> dict[str, Array]:
    """Linear, or of equal percentage with rangeability R. Source: IEC 60534-2-4."""
    travel = x["x"] / 100.0
    share = form["R"] ** (travel - 1.0) if form else travel
    loss = p["k"] + 1.0 / (p["Kv"] * share * off["opening"]) ** 2
    return {"Q": np.sqrt(x["dp"] / (loss * off["resistance"]))}


def _pipe(p: Numbers, x: Arrays, off: Arrays, form: Numbers) -> dict[str, Array]:
    """Loss with a power of the flow. Source: Blasius 1913."""
    share = x["dp"] / (p["k"] * FLOW**2)
    return {"Q": FLOW * share ** (1.0 / form.get("m", 2.0)) * off["Q_law"]}


def _set(p: Numbers, x: Arrays, off: Arrays, form: Numbers) -> dict[str, Array]:
    """Laminar slip; viscosity falls exponentially with temperature. Source: Reynolds 1886."""
    slip = p["C1"] * x["dp"] * np.exp(form.get("b", 0.0) * (x["T"] - WARM))
    return {
        "Q": (p["Q0"] - slip) * off["Q_law"],
        "P_el": (p["P0"] + p["P1"] * x["dp"]) * off["P_law"],
    }


def _share(unit: str, percent: float) -> Sensor:
    return Sensor(unit, 1.0, percent / 100.0, 0.0, relative=True)


def _bound(unit: str, bound: float) -> Sensor:
    return Sensor(unit, 1.0, bound, 0.0)


@dataclass(frozen=True)
class Kind:
    """A law that may be of another form.

    Attributes
    ----------
    type, law : the module type, and how a plant of it truly is
    sensors : by signal, as their classes have them
    ranges : of each setting
    arguments : of each law, by its name in the module type
    form : smallest and largest size of the other form, by parameter
    names, places : entries of the catalogue and places of the module type that are right for it
    """

    type: str
    law: Law
    sensors: Mapping[str, Sensor]
    ranges: Mapping[str, tuple[float, float]]
    arguments: Mapping[str, tuple[str, ...]]
    form: Mapping[str, tuple[float, float]]
    names: tuple[str, ...]
    places: tuple[str, ...]


_PUMP: dict[str, Any] = {
    "type": "contact-pump",
    "law": _pump,
    "sensors": {
        "n": _bound("rpm", 8.0),
        "Q": _share("m3/h", 0.4),
        "dp": _bound("bar", 0.03),
        "P_el": _share("W", 0.2),
    },
    "ranges": {"n": (1600.0, 2900.0), "Q": (3.0, 12.0)},
    "arguments": {"dp_law": ("n", "Q"), "P_law": ("n", "Q")},
}
KINDS: Mapping[str, Kind] = {
    "valve-characteristic": Kind(
        "contact-valve",
        _valve,
        {"x": _bound("%", 0.5), "dp": _bound("bar", 0.03), "Q": _share("m3/h", 0.4)},
        {"x": (20.0, 100.0), "dp": (0.6, 4.0)},
        {"opening": ("x",), "resistance": ("dp",)},
        {"R": (20.0, 50.0)},
        ("equal-percentage",),
        ("x", "opening", "resistance", "valve"),
    ),
    # No entry of the catalogue has the flow with another exponent in a head.
    "pump-curve-exponent": Kind(
        **_PUMP, form={"m": (1.0, 1.3)}, names=(), places=("dp_law", "head", "dp", "Q_imp")
    ),
    "pipe-exponent": Kind(
        "contact-pipe",
        _pipe,
        {"dp": _bound("bar", 0.01), "Q": _share("m3/h", 0.4)},
        {"dp": (0.1, 1.8)},
        {"Q_law": ("dp",)},
        {"m": (1.6, 1.8)},
        ("line-exponent", "pump-exponent"),  # a power of the loss is one of the flow
        ("loss", "Q_law", "dp", "pipe"),
    ),
    "slip-by-temperature": Kind(
        "contact-set",
        _set,
        {
            "dp": _bound("bar", 0.25),
            "P_el": _share("W", 0.2),
            "T": _bound("degC", 0.3),
            "Q": _share("l/min", 0.5),
        },
        {"dp": (60.0, 180.0)},
        {"Q_law": ("dp",), "P_law": ("dp",)},
        {"b": (0.03, 0.05)},
        ("slip-temperature",),
        ("Q_law", "pump"),
    ),
    "power-offset": Kind(
        **_PUMP,
        form={"c": (100.0, 250.0)},
        names=("standby-power", "offset-power"),
        places=("P_law", "power", "P_el"),
    ),
}
"""In the order of the issue that asked for them."""


@dataclass(frozen=True, kw_only=True)
class ContactAnswer(Answer):
    """What is true of a first contact.

    Attributes
    ----------
    values : true parameters, by `module.parameter`
    allowed : error of each output that laws within their accuracy and sensors within their class
        explain, root mean square over the recording
    """

    values: Mapping[str, float]
    allowed: Mapping[str, float]


@dataclass(frozen=True)
class Planned:
    """A first contact to be made; the same seed gives the same bytes."""

    seed: int
    kind: str
    other: bool

    @property
    def group(self) -> str:
        """What kind of case it is."""
        return "contact"

    @property
    def name(self) -> str:
        """Unique in a run."""
        return f"contact-{self.seed:02d}-{self.kind}{'' if self.other else '-sound'}"

    def make(self) -> Contact:
        """Draw sheet, truth and operation."""
        kind, random = KINDS[self.kind], stream(self.seed, "contact")
        type_ = module_type(kind.type)
        sheet, true = {}, {}
        for name, stated in type_["parameters"].items():
            value = stated["value"]
            if stated["u"]:
                scaled = value * float(random.uniform(0.8, 1.25))
                sheet[name] = float(f"{scaled:.4g}"), float(f"{stated['u'] * scaled / value:.3g}")
                value = sheet[name][0] * factor(sheet[name][1] / sheet[name][0], random)
            true[name] = value
        accuracy = {law: _accuracy(type_, law) for law in kind.arguments}
        forms = {
            law: form_error(random, 0.5 * accuracy[law], tuple(kind.ranges[a] for a in arguments))
            for law, arguments in kind.arguments.items()
        }
        form = {name: float(random.uniform(*ends)) for name, ends in kind.form.items()}
        given = _operated(kind, random)
        off = {law: 1.0 + forms[law](*(given[a] for a in kind.arguments[law])) for law in forms}
        truly = kind.law(true, given, off, form if self.other else {})
        allowed = _allowed(kind, true, given, accuracy)
        answer = _answer(self, form, {f"{MODULE}.{n}": true[n] for n in sheet}, allowed)
        return Contact(kind, sheet, answer, {**given, **truly})


@dataclass(frozen=True)
class Contact:
    """A first contact; `sheet` has value and u of each parameter, `true` all signals."""

    kind: Kind
    sheet: Mapping[str, tuple[float, float]]
    answer: ContactAnswer
    true: Arrays = field(repr=False)

    def write(self, folder: Path) -> None:
        """Write `plant/`, with the module type in its own knowledge, and `recording.csv`."""
        modules = folder / "plant" / "kb" / "modules"
        modules.mkdir(parents=True, exist_ok=True)
        shutil.copy(_file(self.kind.type), modules)
        units = module_type(self.kind.type)["parameters"]
        lines = ["plant: contact", "title: A plant from its data sheet", "modules:"]
        lines += [f"  {MODULE}:", f"    type: {self.kind.type}", "    parameters:"]
        lines += [
            f"      {name}: {{value: {value!r}, unit: {units[name]['unit']}, u: {u!r}, "
            "source: data sheet}"
            for name, (value, u) in self.sheet.items()
        ]
        plant = folder / "plant" / "plant.yaml"
        plant.write_text("\n".join(lines) + "\n", encoding="utf-8")
        columns: dict[str, Array] = {"time [s]": PACE * np.arange(SAMPLES, dtype=np.float64)}
        for name, sensor in self.kind.sensors.items():
            place = f"{MODULE}.{name}"
            shown = read(sensor, place, self.true[name], SENSING, self.answer.seed)
            columns[f"{place} [{sensor.unit}]"] = shown
        write_csv(folder / "recording.csv", columns)

    def reference(self, request: Request) -> Reference:
        """None: first contacts are judged by what laws may be off, not against the true model."""
        return Reference({})


def planned(first: int, count: int = CASES) -> Iterator[Planned]:
    """Cases of the seeds from `first` on: each kind in turn, once sound, once of another form."""
    kinds = list(KINDS)
    for seed in range(first, first + count):
        turn = seed - 1
        yield Planned(seed, kinds[turn // 2 % len(kinds)], bool(turn % 2))


@functools.cache
def module_type(name: str) -> Mapping[str, Any]:
    """A module type of this folder."""
    found: Mapping[str, Any] = yaml.safe_load(_file(name).read_text(encoding="utf-8"))
    return found


def _file(name: str) -> Path:
    return Path(__file__).with_name(f"{name}.yaml")


def _accuracy(type_: Mapping[str, Any], law: str) -> float:
    return float(type_["definitions"][law]["accuracy"].partition("%")[0]) / 100.0


def _operated(kind: Kind, random: np.random.Generator) -> dict[str, Array]:
    """Ordinary operation: each setting in a part of its range; slow temperatures."""
    given = {}
    for name, (low, high) in kind.ranges.items():
        part = float(random.uniform(*PART))
        share = part * PROFILES[int(random.integers(len(PROFILES)))](random, SAMPLES)
        given[name] = low + (high - low) * (share + float(random.uniform(0.0, 1.0 - part)))
    if "T" in kind.sensors:
        given["T"] = drive.temperature(random, SAMPLES) - ZERO_CELSIUS
    return given


def _allowed(kind: Kind, true: Numbers, given: Arrays, accuracy: Numbers) -> dict[str, float]:
    """By one step for each law and sensor. Source: GUM, 5.1.2."""
    one: dict[str, Array] = {law: np.ones(SAMPLES) for law in accuracy}
    plain = kind.law(true, given, one, {})
    moved = [kind.law(true, given, {**one, law: one[law] + a}, {}) for law, a in accuracy.items()]
    for name in given:
        moved.append(
            kind.law(true, {**given, name: given[name] + _class(kind, name, given)}, one, {})
        )
    squares = {
        out: sum(((m[out] - value) ** 2 for m in moved), _class(kind, out, plain) ** 2)
        for out, value in plain.items()
    }
    return {f"{MODULE}.{out}": float(np.sqrt(np.mean(s))) for out, s in squares.items()}


def _class(kind: Kind, name: str, values: Arrays) -> Array:
    sensor = kind.sensors[name]
    return sensor.bound * (np.abs(values[name]) if sensor.relative else np.ones(SAMPLES))


def _answer(plan: Planned, form: Numbers, values: Numbers, allowed: Numbers) -> ContactAnswer:
    kind = KINDS[plan.kind]
    planted = Planted(
        effect=plan.kind,
        title=plan.kind.replace("-", " "),
        sort="physics" if kind.names else "unnamed",
        module=MODULE,
        place=kind.places[0],
        names=kind.names,
        places=tuple(f"{MODULE}.{place}" for place in kind.places),
        parameters={plan.kind: form},
        gain=float("nan"),
        margin=float("nan"),
        rival="",
    )
    effects = (planted,) if plan.other else ()
    return ContactAnswer(
        case=plan.name,
        half="stationary",
        plant=kind.type,
        profile="ordinary",
        seed=plan.seed,
        samples=SAMPLES,
        verdict=verdict_of([p.sort for p in effects]),
        concealed=("open",) if effects else ("clean",),
        effects=effects,
        values=values,
        allowed=allowed,
    )
