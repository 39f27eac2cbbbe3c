"""How recordings are written, as far as a column map says it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Order = Literal["", "year first", "day first", "month first"]

START = "start"
"""Times that are numbers count from a zero of their own."""

OPC_UA, OPC_DA = "opc ua", "opc da"
"""Codes of quality that a name stands for: good is below 2**30, or from 192 to 255."""


@dataclass(frozen=True, kw_only=True)
class FileForm:
    """What a person sees in a file; what is empty is to be seen from the file itself.

    Attributes
    ----------
    layout : ``wide`` (a column per signal), ``long`` (a reading a row) or ``pairs`` (each column
        behind one with its times).
    time : columns that make a time together: one, or date, time of day and milliseconds.
    dates : what stands first in a date of numbers.
    since : the date from which times that are numbers count, with Z where it is in UTC; or
        ``start``.
    time_factor : seconds per unit of such times; 0 where nothing says it.
    tag, value, quality : columns of a long table; in a wide one `quality` is what a column of
        qualities is called behind the name of its reading.
    good : qualities that are good, or the name of a standard's codes.
    hold : ``last`` where a reading holds until the next one, ``never`` where it does not;
        `hold_for` is for how long at most, s.
    decimal, thousands : signs in numbers.
    missing : numbers that stand for no reading.
    """

    layout: Literal["", "wide", "long", "pairs"] = ""
    time: tuple[str, ...] = ()
    dates: Order = ""
    since: str = ""
    time_factor: float = 0.0
    tag: str = ""
    value: str = ""
    quality: str = ""
    good: tuple[str, ...] = ()
    hold: Literal["", "last", "never"] = ""
    hold_for: float | None = None
    decimal: Literal["", ".", ","] = ""
    thousands: str = ""
    missing: tuple[float, ...] = ()

    @property
    def time_title(self) -> str:
        """What the column of times is called; of several, all of them."""
        return " ".join(self.time)

    @property
    def words_are_placed(self) -> bool:
        """Whether it matters in which row a word stands in place of a reading."""
        return self.hold == "last" or self.layout in ("long", "pairs")


AS_SEEN = FileForm()
"""Nothing is said."""
