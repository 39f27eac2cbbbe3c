"""Format numbers and names for a report."""

import html
import re
import unicodedata
from collections.abc import Sequence

import numpy as np

_UNSHOWN = ("Cc", "Cf", "Cs", "Co", "Cn")
"""Unicode categories that a page cannot show, or that would reverse its text."""


class Html(str):
    """Text that is HTML already."""


def safe(text: str) -> str:
    """Text for HTML and XML: escaped, and without characters that they cannot hold; `Html` as is.

    >>> safe('<b>"A & B"'), safe(Html("<b>A</b>"))
    ('&lt;b&gt;&quot;A &amp; B&quot;', '<b>A</b>')
    """
    if isinstance(text, Html):
        return text
    joined = re.sub(r"[ \t\r\n]+", " ", text)
    shown = ("�" if unicodedata.category(c) in _UNSHOWN else c for c in joined)
    return html.escape("".join(shown))


def number(value: float, digits: int = 3) -> str:
    """A number with `digits` significant digits, separated thousands and a true minus sign.

    >>> number(128699.0, 6), number(-0.05021), number(314.21), number(0.0)
    ('128\u202f699', '−0.0502', '314', '0')
    """
    if not np.isfinite(value):
        return "–"
    size = int(np.floor(np.log10(abs(value)))) if value else 0
    text = fixed(value, max(digits - 1 - size, 0))
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return text


def fixed(value: float, decimals: int) -> str:
    """A number with a fixed number of decimals.

    >>> fixed(0.15, 3), fixed(-1234.5, 1)
    ('0.150', '−1\u202f234.5')
    """
    if not np.isfinite(value):
        return "–"
    return f"{value:,.{decimals}f}".replace(",", "\u202f").replace("-", "−")


def degree(value: float, unit: str = "") -> str:
    """A degree as the terminal shows it: a share with three decimals, or a size in its unit.

    >>> degree(0.17), degree(2.0, "K")
    ('0.170', '2\xa0K')
    """
    if not np.isfinite(value):
        return "–"
    return f"{value:.3g}\u00a0{unit}" if unit else f"{value:.3f}"


def bounds(low: float, high: float, unit: str = "") -> str:
    """The 95 % bounds of a degree.

    >>> bounds(0.587, 0.611)
    '95\xa0%: 0.587 to 0.611'
    """
    return f"95\u00a0%: {degree(low, unit)} to {degree(high, unit)}"


def moment(seconds: float) -> str:
    """A time in seconds, without the unit.

    >>> moment(126839.0), moment(12.25)
    ('126\u202f839', '12.25')
    """
    if not np.isfinite(seconds):
        return "–"
    digits = 3 if abs(seconds) < 1 else 6
    return number(seconds, max(digits, len(str(int(abs(seconds))))))


def percent(share: float) -> str:
    """A share in percent; only an exact 0 or 1 becomes 0 or 100 %.

    >>> percent(0.5), percent(0.9999), percent(0.001), percent(1.0)
    ('50\xa0%', '>99\xa0%', '<1\xa0%', '100\xa0%')
    """
    rounded = round(100 * share)
    if rounded == 100 and share < 1 - 1e-9:
        return ">99\u00a0%"
    if rounded == 0 and share > 0:
        return "<1\u00a0%"
    return f"{rounded}\u00a0%"


def listed(names: Sequence[str]) -> str:
    """Names in a sentence.

    >>> listed(["A", "B", "C"])
    'A, B and C'
    """
    if len(names) < 2:
        return "".join(names)
    return ", ".join(names[:-1]) + " and " + names[-1]


def counted(count: int, noun: str) -> str:
    """A count with its noun.

    >>> counted(1, "sample"), counted(1200, "sample")
    ('1 sample', '1\u202f200 samples')
    """
    return f"{count:,}".replace(",", "\u202f") + f" {noun}" + "s" * (count != 1)
