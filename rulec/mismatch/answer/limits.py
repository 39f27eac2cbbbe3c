"""Every number that decides in what is told of a mismatch, with its origin."""

from __future__ import annotations

# Verdicts.

MAJOR = 0.5
"""Share of what could be explained that names must have, beside a driver that nobody recorded.
Origin: assumed."""

SPOILED = 0.05
"""Rise of a reading's held-out error, as a share, from which on a repair had better not be used.
Origin: assumed."""

SAME_ERROR = 1e-6
"""Share by which an error may exceed another and still be the same: digits of files and solvers.
Origin: numerical."""

# Displays with coarse steps.

CURVE_CLEAR = 3.0
"""Standard uncertainties by which a curve must rise or fall to be told so: it is looked at between
all of its points. Origin: distribution (normal, 1 of 400, some ten independent points)."""

CURVE_STEP = 0.15
"""Share of the height of a curve below which a rise or fall is not told. Origin: assumed."""

CURVE_FLAT = 0.1
"""Share of a rise at either end of it that counts as flat. Origin: assumed."""

CURVE_WHOLE = 0.7
"""Share of a driver's range from which on a rise is told as steady. Origin: assumed."""

BRANCHES_CLEAR = 3.0
"""Standard uncertainties by which branches must differ to be told apart. Origin: distribution
(normal, 1 of 400)."""

BRANCHES_COUNT = 0.2
"""Share of the height of a curve that a gap between branches must have to count; a gap that is
smaller for sure is none. Origin: assumed."""
