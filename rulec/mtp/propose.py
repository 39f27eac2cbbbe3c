"""Propose what a tag measures, from its unit, its name and its description."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rulec.language.units import NONE, Unit, UnitTable
from rulec.mtp.tables import tables

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
    named = _named(name, title)
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


def _named(name: str, title: str) -> list[tuple[str, str]]:
    """Quantities that words and letters suggest, each with its evidence.

    >>> _named("Sensoren.FI2012", "Durchfluss am Eingang")[0]
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
