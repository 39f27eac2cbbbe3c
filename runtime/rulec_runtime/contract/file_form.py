"""The form of recording files, as far as a column map states it."""

from dataclasses import dataclass
from typing import Literal

Order = Literal["", "year first", "day first", "month first"]

START = "start"
"""Times are numbers that count from a zero of their own."""

OPC_UA, OPC_DA = "opc ua", "opc da"
"""Names of standard quality codes: good is below 2**30, or from 192 to 255."""


@dataclass(frozen=True, kw_only=True)
class FileForm:
    """The form of a file; whatever is empty is inferred from the file itself.

    Attributes
    ----------
    layout : ``wide`` (a column per signal), ``long`` (a row per reading) or ``pairs`` (each column
        follows one with its times).
    time : columns that make a time together: one, or date, time of day and milliseconds.
    dates : what comes first in a date of numbers.
    since : the date from which numeric times count, with Z where it is in UTC; or ``start``.
    time_factor : seconds per unit of such times; 0 if unknown.
    tag, value, quality : columns of a long table; in a wide one `quality` is the suffix of a
        quality column, behind the name of its reading.
    good : good qualities, or the name of a standard's codes.
    hold : ``last`` if a reading holds until the next one, ``never`` if it does not; `hold_for` is
        the longest time, s.
    decimal, thousands : signs in numbers.
    missing : numbers that mark a missing reading.
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
        """Title of the time column; of several, all of them."""
        return " ".join(self.time)

    @property
    def words_are_placed(self) -> bool:
        """Whether the row of a word in place of a reading matters."""
        return self.hold == "last" or self.layout in ("long", "pairs")


INFERRED = FileForm()
"""Everything is inferred from the file."""
