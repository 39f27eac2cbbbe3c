"""Every number that decides in the fit of one model, with its origin."""

from __future__ import annotations

# Intervals and held-out blocks.

LONGEST_STEP = 3.0
"""Factor by which a step to the end of an interval grows at most. Origin: numerical."""

CONFOUNDED = 0.9
"""Correlation beyond which two values are not told apart. Origin: assumed."""

DRAWS = 1000
"""Draws of the bootstrap over held-out blocks. Origin: numerical."""

CHUNKS = 20
"""Pieces of the held-out points that the bootstrap draws from. Origin: assumed."""
