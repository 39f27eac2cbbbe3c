"""Find the readings of a package: which tag is a signal, its unit, range and node."""

from __future__ import annotations

import keyword
import math
import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from rulec.knowledge.knowledge import SensorClass
from rulec.language.units import NONE, Unit, UnitTable
from rulec.mtp import limits
from rulec.mtp.package import Attribute, Node, Oddity, Package, Tag
from rulec.mtp.tables import tables

_UMLAUTS = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss"}
)


@dataclass(frozen=True, kw_only=True)
class Reading:
    """A number that a tag gives. `range` is None if unknown; `lacks` says what a person must fill
    in before it becomes a signal, and is empty if it is one."""

    signal: str
    tag: Tag
    attribute: str
    unit: FoundUnit
    range: tuple[float, float] | None
    range_is_default: bool
    limits: Mapping[str, str]
    proposal: Proposal
    sensor: str
    is_input: bool
    repeats: bool
    lacks: str

    @property
    def node(self) -> Node | None:
        """The node that holds it."""
        return self.tag.attributes[self.attribute].node


def readings_of(
    package: Package, units: UnitTable, sensors: Mapping[str, SensorClass]
) -> tuple[list[Reading], list[Oddity]]:
    """Readings of all tags under unique names, and their oddities."""
    odd: list[Oddity] = []
    found = [
        _reading(tag, where, units, sensors, odd)
        for tag in package.tags
        for where in tables().values.get(tables().classes.get(tag.kind, ""), ())
        if any(name in tag.attributes for name in where["value"])
    ]
    return list(_named(found)), odd


def _reading(
    tag: Tag,
    where: Mapping[str, Any],
    units: UnitTable,
    sensors: Mapping[str, SensorClass],
    odd: list[Oddity],
) -> Reading:
    present = [name for name in where["value"] if name in tag.attributes]
    bound = [name for name in present if tag.attributes[name].node is not None]
    held = tag.attributes.get(f"{where['scale']}Unit")
    unit, repeats = unit_of(held, units), bool(where.get("repeats"))
    span, default = _range(tag, where["scale"], odd)
    proposal = propose(tag.name, tag.title, unit.unit, where.get("usual", ""), units)
    sensor, range_is_needed = _sensor(proposal.quantity, span, unit, sensors)
    values = {name: attribute.value for name, attribute in tag.attributes.items()}
    if unit.raw.strip("0.") and not unit.text:
        text = f"{tag.name} has the unit '{unit.raw[:40]}', which is no unit code that is known"
        remedy = "write the unit into the skeleton" + ", or import with --online" * unit.online
        odd.append(Oddity("unknown units", held.place if held else tag.place, text, remedy))
    if proposal.against and not repeats:
        text = f"{tag.name}: {proposal.against}"
        remedy = "find out what it measures, and correct the quantity"
        odd.append(Oddity("names against units", tag.place, text, remedy))
    return Reading(
        signal="",
        tag=tag,
        attribute=(bound or present)[0],
        unit=unit,
        range=span,
        range_is_default=default,
        limits={name: values[name] for name in tables().limits if values.get(name)},
        proposal=proposal,
        sensor=sensor,
        is_input=bool(where.get("input")),
        repeats=repeats,
        lacks=_lacks(unit, proposal.quantity, sensor, range_is_needed),
    )


def _lacks(unit: FoundUnit, quantity: str, sensor: str, range_is_needed: bool) -> str:
    if unit.online and not unit.text:
        return "the unit: the controller holds it"
    if not unit.raw:
        return "the unit: the data sheet says it"
    if not unit.text:
        return f"the unit: '{unit.raw[:20]}' is no unit code that is known"
    if unit.unit is None:
        return f"the unit {unit.text}: it is not in units.yaml; add it, or another"
    if not quantity:
        return f"a quantity for {unit.text}: units.yaml has none"
    if not sensor:
        return "a sensor class for this quantity"
    return "the range, which the sensor class needs" if range_is_needed else ""


def _range(tag: Tag, scale: str, odd: list[Oddity]) -> tuple[tuple[float, float] | None, bool]:
    """The range that the file gives, and whether it is a default that may be replaced."""
    low, high = (tag.attributes.get(f"{scale}Scl{end}") for end in ("Min", "Max"))
    if low is None or high is None or not low.value or not high.value:
        return None, False
    first, last = _number(low.value), _number(high.value)
    if first is None or last is None:
        text = f"{tag.name} ranges from '{low.value[:30]}' to '{high.value[:30]}'"
        remedy = "take the range from the data sheet"
    elif first >= last:
        text = f"{tag.name} ranges from {first:g} to {last:g}"
        remedy = "the lower end comes first; take the range from the data sheet"
    else:
        return (first, last), low.is_default or high.is_default
    odd.append(Oddity("ranges that are none", low.place, text, remedy))
    return None, False


def _number(text: str) -> float | None:
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return value if math.isfinite(value) and abs(value) < 1e30 else None


def _sensor(
    quantity: str,
    span: tuple[float, float] | None,
    unit: FoundUnit,
    sensors: Mapping[str, SensorClass],
) -> tuple[str, bool]:
    """A sensor class of the knowledge base, and whether it needs a range that is missing."""
    needing = ""
    for name in tables().sensors.get(quantity, ()):
        one = sensors.get(name)
        if one is None or (
            one.kind == "value" and unit.unit and one.unit.dimension != unit.unit.dimension
        ):
            continue
        if one.kind != "full scale" or span is not None:
            return name, False
        needing = needing or name
    return needing, bool(needing)


def _named(found: list[Reading]) -> Iterator[Reading]:
    """Readings with signal names: the last part of the tag's name, if that is unique."""
    short = [signal_name(r.tag.name.rpartition(".")[2], r.tag.kind) for r in found]
    uses = Counter(short)
    taken: Counter[str] = Counter()
    for reading, name in zip(found, short, strict=True):
        if uses[name] > 1:
            name = signal_name(reading.tag.name, reading.tag.kind)
        name = f"{name}_" if keyword.iskeyword(name) else name
        while name in taken:
            taken[name] += 1
            name = f"{name[: limits.LONGEST_SIGNAL - 6]}_{taken[name]}"
        taken[name] = 1
        yield replace(reading, signal=name)


def signal_name(text: str, kind: str = "") -> str:
    """A name for a signal that equations can use.

    >>> signal_name("Füllstand L-001"), signal_name("3021"), signal_name("L1_MonAnaVlv", "AnaVlv")
    ('Fuellstand_L_001', 'x3021', 'L1')
    """
    short = re.sub(rf"[_.](Mon|Lock)*{kind}$", "", text) if kind else text
    name = re.sub(r"[^A-Za-z0-9]+", "_", _plain(short)).strip("_")
    name = name if name[:1].isalpha() else f"x{name}"
    return name[: limits.LONGEST_SIGNAL].rstrip("_")


def module_name(text: str) -> str:
    """A name for a module type.

    >>> module_name("PiMAd-core:0.0.1"), module_name("(1)")
    ('PiMAd-core-0-0-1', 'module-1')
    """
    name = re.sub(r"_*[^A-Za-z0-9_]+_*", "-", _plain(text)).strip("-_")
    name = name if name[:1].isalpha() else f"module-{name}".rstrip("-")
    return name[: limits.LONGEST_MODULE].rstrip("-_")


def _plain(text: str) -> str:
    spelled = unicodedata.normalize("NFKD", text.translate(_UMLAUTS))
    return spelled.encode("ascii", "ignore").decode()


@dataclass(frozen=True, kw_only=True)
class FoundUnit:
    """A unit of a package.

    `raw` is its text in the package, `text` the spelling of the tables (empty if unknown), `unit`
    that of the knowledge base (None if it has none). `is_default`: it is a default of the file;
    `online`: a node holds it.
    """

    raw: str
    text: str
    unit: Unit | None
    is_default: bool
    online: bool


def unit_of(attribute: Attribute | None, units: UnitTable) -> FoundUnit:
    """The unit that an attribute gives by a code or by a text."""
    raw = attribute.value.strip() if attribute is not None else ""
    key = raw[:-2] if raw.endswith(".0") else raw
    text = tables().codes.get(key, "")
    if not text and key and _number(key) is None:
        spelled = tables().spellings.get(key, key)
        text = spelled if _parsed(spelled, units) is not None else ""
    return FoundUnit(
        raw=raw,
        text=text,
        unit=_parsed(text, units) if text else None,
        is_default=attribute is not None and attribute.is_default,
        online=attribute is not None and attribute.node is not None,
    )


def _parsed(text: str, units: UnitTable) -> Unit | None:
    try:
        return units.parse(text)
    except ValueError:
        return None


LIKELY, POSSIBLE, GUESS = "likely", "possible", "guess"

_LETTERS = re.compile(r"(?:^|[^A-Za-z])([A-Z]{1,4})[-_ ]?\d")


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A quantity (empty if unknown), and why. `against` is the evidence against it."""

    quantity: str
    confidence: str
    because: str
    against: str


def propose(name: str, title: str, unit: Unit | None, usual: str, units: UnitTable) -> Proposal:
    """The quantity of a reading.

    Parameters
    ----------
    name, title : of the tag.
    unit : of the reading, None if unknown.
    usual : what a tag of this role usually measures, empty if it may be anything.
    units : quantities of the knowledge base.
    """
    named = _suggested(name, title)
    hints = [*([(usual, "its class")] if usual else []), *named]
    if unit is None:
        quantity, why = hints[0] if hints else ("", "")
        return Proposal(quantity=quantity, confidence=GUESS, because=why, against="")
    fitting = [q for q, d in units.quantities.items() if d == unit.dimension]
    for quantity, why in hints:
        if quantity in fitting:
            because = f"unit and {why}"
            return Proposal(quantity=quantity, confidence=LIKELY, because=because, against="")
    quantity = next((q for q in [*tables().first, *fitting] if q in fitting), "")
    against = ""
    if named and fitting and unit.dimension != NONE:
        against = f"{named[0][1]} speaks of {named[0][0]}, the unit {unit.text} does not"
    confidence = GUESS if against or unit.dimension == NONE else POSSIBLE
    return Proposal(quantity=quantity, confidence=confidence, because="unit", against=against)


def _suggested(name: str, title: str) -> list[tuple[str, str]]:
    """Quantities that words and letters suggest, each with its evidence.

    >>> _suggested("Sensoren.FI2012", "Durchfluss am Eingang")[0]
    ('volume flow', "'durchfluss'")
    """
    found = []
    for text in (title.lower(), name.lower()):
        for quantity, words in tables().words.items():
            found += [(quantity, f"'{word}'") for word in words if word in text]
    for letters in _LETTERS.findall(name.rpartition(".")[2]):
        for key in (letters[:2], letters[:1]):
            if key in tables().letters:
                found.append((tables().letters[key], f"the letter {key}"))
                break
    return found
