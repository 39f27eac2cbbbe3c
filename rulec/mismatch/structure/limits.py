"""Every number that decides in errors of structure, with its origin."""

# Columns that differ from their header.

GROSSLY_OFF = 5.0
"""Deviation of a comparison, in its noise, above which it counts as gross. Origin: distribution,
far beyond any quantile of a normal one that a recording reaches."""

GROSS_SHARE = 0.05
"""Share of gross comparisons above which headers are doubted: a wrong column affects all
comparisons that read it. Origin: numerical."""

UNREAD = 100.0
"""Assumed deviation of an impossible reading, in its noise: for a 1 % sensor the reading itself.
Origin: assumed."""

STRUCTURE_ODDS = -5.0
"""Log odds that some column of a recording differs from its header: one recording in 150. Origin:
assumed."""

STRUCTURE_LEAVES = 0.5
"""Share of the disagreement, in logs of its size, that reading otherwise may leave: more means that
it is merely reduced. Origin: assumed."""

STRUCTURE_READS = 0.9
"""Share of the most comparisons of any hypothesis that a hypothesis must allow. Origin: assumed."""

HARDLY_USED = 0.1
"""Share of points below which an estimate counts as hardly ever used. Origin: assumed."""

STRUCTURE_STEPS = 6
"""Steps of a refit of the plain model. Origin: numerical."""

STRUCTURE_SCATTER = 0.1
"""Prior size of errors as a share of the standard deviation of a reading. Origin: numerical."""

STRUCTURE_ROUNDS = 3
"""Rounds of a refit of a plant that stores, each with the noise of the last. Origin: numerical."""

STRUCTURE_REFITTED = 5
"""Hypotheses that are refitted, best first. Origin: numerical."""

STRAINED = 100.0
"""How far the refit of the plain model must move parameters, as a negative log prior, nats, before
connections are doubted without gross comparisons. Origin: numerical (clean plants: 17 at most)."""

MOST_REWIRINGS = 40
"""Most other connections that are tried, those at the largest contradictions first. Origin:
numerical."""

REWIRED_READS = 0.7
"""Share of the most comparisons of any network that a network must allow: a pump with a longer way
is less often settled and above the loss of its line. Origin: assumed."""

STRUCTURE_RIVAL_STEPS = 12
"""Steps of a refit of an explanation that another connection must beat. Origin: numerical."""

MOST_MISREAD = 3
"""Most columns, or pairs of them, that are read otherwise: a file with more is of another plant.
Origin: assumed."""

MOVING_SAMPLES = 3000
"""Approximate number of samples in the search for a clock. Origin: numerical."""

CLOCK_SHIFTS = (1, 2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256)
"""Shifts of a column to try first, in samples. Origin: numerical (a root of two apart)."""

LATEST = 0.1
"""Largest shift of a column as a share of the recording. Origin: assumed."""

LAG_SHARES = (0.3, 0.5, 0.8, 1.3, 2.0, 3.0)
"""Lags to try instead of a shift, as shares of it: an equal one delays a step as much on average.
Origin: numerical."""

CLOCK_LEAVES = 0.25
"""Share of the disagreement around changes, in logs of its size, that a shift may leave. In
simulated plants that settle, right shifts left at most 0.08; wrong ones, where states are shorter
than the delay of a column, at least 0.45. Origin: assumed, between the two."""
