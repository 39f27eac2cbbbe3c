"""Every number that decides in the inference on one model, with its origin."""

# Intervals and held-out blocks.

PROFILE_STEPS = 5
"""Most steps to an end of an interval. Origin: numerical."""

PROFILE_NEAR = 0.1
"""Deviation of the log likelihood there from its target at which the search ends. Origin:
numerical."""

GROWTH = (1.1, 3.0)
"""Least and largest growth factor of a step towards the end of an interval. Origin: numerical."""

CONFOUNDED = 0.9
"""Correlation above which two values count as confounded. Origin: assumed."""

DRAWS = 1000
"""Draws of the bootstrap over held-out blocks. Origin: numerical."""

CHUNKS = 20
"""Pieces of the held-out points that the bootstrap draws from. Origin: assumed."""

# Replays by the plant's own model.

REPLAYS = 200
"""Replays per question: a rate to three points. Origin: numerical."""

SEEN = 0.5
"""Share of replays in which an effect must be found to count as detectable. Origin: assumed."""

SEEN_STEPS = 5
"""Bisections, in logarithms, to find the smallest detectable size. Origin: numerical."""

SEEN_REACH = 10
"""Doublings of the usual size, up or down, within which that size is sought. Origin: numerical."""

SEEN_REPLAYS = 60
"""Replays in that search: a share to six points. Origin: numerical."""
