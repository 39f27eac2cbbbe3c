"""Every number that decides in the inference on one model, with its origin."""

# Intervals and held-out blocks.

LONGEST_STEP = 3.0
"""Largest growth factor of a step towards the end of an interval. Origin: numerical."""

CONFOUNDED = 0.9
"""Correlation above which two values count as confounded. Origin: assumed."""

DRAWS = 1000
"""Draws of the bootstrap over held-out blocks. Origin: numerical."""

CHUNKS = 20
"""Pieces of the held-out points that the bootstrap draws from. Origin: assumed."""

# Replays by the plant's own model.

REPLAYS = 200
"""Replays per question: a rate to three points. Origin: numerical."""

WIDTHS = (0.4, 1.4, 5.0, 17.0, 60.0, 210.0, 740.0)
"""Widths of the normal distributions that approximate a Student distribution of sizes, in its own:
its density is met within 0.25 nats at one degree of freedom, 0.8 at three. Origin: numerical."""

SCORED = 3
"""Iterations in which residuals of replays are replaced by their score: a fourth changes nothing.
Origin: numerical."""

SEEN = 0.5
"""Share of replays in which an effect must be found to count as detectable. Origin: assumed."""

SEEN_STEPS = 5
"""Bisections, in logarithms, to find the smallest detectable size. Origin: numerical."""

SEEN_REACH = 14
"""Doublings of the usual size, up or down, within which that size is sought. Origin: numerical."""

CANNOT_COUNT = -12.0
"""Log odds at the best size below which an explanation of a replay is ignored. Origin: numerical.
"""

FAR_BEHIND = 40.0
"""Log odds at the best size by which it may be below the best explanation nevertheless: the prior
of sizes and ranges never compensates for more. Origin: numerical."""

SEEN_REPLAYS = 60
"""Replays in that search: a share to six points. Origin: numerical."""
