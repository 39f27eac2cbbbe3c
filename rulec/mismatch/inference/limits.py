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

# Replays by the plant's own model.

REPLAYS = 200
"""Replays per question: a rate to three points. Origin: numerical."""

WIDTHS = (0.4, 1.4, 5.0, 17.0, 60.0, 210.0, 740.0)
"""Widths of the normal distributions that stand for a Student distribution of sizes, in its own:
its density is met within 0.25 nats at one degree of freedom, 0.8 at three. Origin: numerical."""

SCORED = 3
"""Times that residuals of replays are replaced by their score: a fourth time changes nothing.
Origin: numerical."""

SEEN = 0.5
"""Share of replays in which an effect is told from which on it is seen. Origin: assumed."""

SEEN_STEPS = 5
"""Halvings, in logarithms, by which the smallest size that is seen is found. Origin: numerical."""

SEEN_REACH = 14
"""Doublings of the usual size, up or down, within which it is looked for. Origin: numerical."""

CANNOT_COUNT = -12.0
"""Log odds at the best size from which on an explanation of a replay is weighed. Origin: numerical.
"""

FAR_BEHIND = 40.0
"""Log odds at the best size by which it may be behind the best one all the same: what is not known
of sizes and ranges never makes up for more. Origin: numerical."""

SEEN_REPLAYS = 60
"""Replays in which that is looked for: a share to six points. Origin: numerical."""
