"""A fault that begins: its degree, from some time on.

What a plant that stores has had from the beginning is part of its calibration. A fault is what was
not there before; so its law holds from a time that is searched for with its degree.
"""

from __future__ import annotations

import ast
import functools

from rulec.language.expression import Expression
from rulec.language.rewrite import replaced, written

SINCE, CLOCK, HALF = "since", "t", "t_half"
"""Names in laws: time of the onset, time, and half of the recording."""

QUANTILES = (0.08, 0.17, 0.26, 0.35, 0.44, 0.53, 0.62, 0.71, 0.8, 0.89)
"""Shares of the recording at which the search for an onset starts."""

LATEST = 1e9
"""s; the recording ends before that."""

RISE = f"(1 + tanh(({CLOCK} - {SINCE})/(0.002*{HALF})))/2"
"""From 0 to 1 within a thousandth of the recording: a step that can be searched for by slopes."""


@functools.cache
def beginning(law: Expression, degree: str = "x") -> Expression:
    """A law over a degree that is there from an onset on.

    >>> from rulec.language.expression import parse
    >>> beginning(parse("law*(1 - x)")).text
    'law*(1 - x*((1 + tanh((t - since)/(0.002*t_half)))/2))'
    """
    rise = ast.parse(f"{degree}*({RISE})", mode="eval").body
    return written(replaced(law.tree, {degree: rise}))
