"""Every number that decides in mistakes of structure, with its origin."""

from __future__ import annotations

# Columns that are not what their header says.

GROSSLY_OFF = 5.0
"""How far a comparison must be off, in its noise, to count as gross. Origin: distribution, far
beyond any quantile of a normal one that a recording reaches."""

GROSS_SHARE = 0.05
"""Share of comparisons that must be grossly off before any header is doubted: a wrong column spoils
all that read it. Origin: numerical."""

UNREAD = 100.0
"""How far a reading that cannot be is taken to be off, in its noise: of a sensor of 1 % as much as
it shows. Origin: assumed."""

STRUCTURE_ODDS = -5.0
"""Log odds that some column of a recording is not what its header says: one recording in 150.
Origin: assumed."""

STRUCTURE_LEAVES = 0.5
"""Share of the disagreement, in logs of its size, that reading otherwise may leave: what leaves
more only lessens it. Origin: assumed."""

STRUCTURE_READS = 0.9
"""Share of the comparisons, of all that any hypothesis allows, that one must allow. Origin:
assumed."""

HARDLY_USED = 0.1
"""Share of points below which an estimate is hardly ever used. Origin: assumed."""

STRUCTURE_STEPS = 6
"""Steps of a refit of the plain model. Origin: numerical."""

STRUCTURE_SCATTER = 0.1
"""Size of errors before any is seen, as a share of how much a reading moves. Origin: numerical."""

STRUCTURE_ROUNDS = 3
"""Rounds of a refit of a plant that stores, each with the noise of the last. Origin: numerical."""

STRUCTURE_REFITTED = 5
"""Hypotheses that are refitted, best first. Origin: numerical."""

STRAINED = 100.0
"""How far the refit of the plain model must move parameters, as a negative log prior, nats, before
connections are doubted though no comparison is grossly off. Origin: measured by `python -m
tests.rig.mismatch.connections` (clean plants: 17 at most).
"""

MOST_REWIRINGS = 40
"""Other connections that are tried at most, those first whose modules contradict others most.
Origin: numerical."""

REWIRED_READS = 0.7
"""Share of the comparisons, of all that any network allows, that one must allow: a pump whose way
is longer is settled, and above its line's loss, less often. Origin: assumed."""

STRUCTURE_RIVAL_STEPS = 12
"""Steps of a refit of an explanation that another connection must beat. Origin: numerical."""

MOST_MISREAD = 3
"""Columns, or pairs of them, that are read otherwise at most: a file with more is another one's.
Origin: assumed."""

MOVING_SAMPLES = 3000
"""Samples, about, at which a clock is looked for. Origin: numerical."""

CLOCK_SHIFTS = (1, 2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256)
"""Samples by which a column is read otherwise at first. Origin: numerical (a root of two apart)."""

LATEST = 0.1
"""Share of a recording by which a column is shifted at most. Origin: assumed."""

LAG_SHARES = (0.3, 0.5, 0.8, 1.3, 2.0, 3.0)
"""Lags that are tried in place of a shift, as share of it: one of as much moves a step as far on
average. Origin: numerical."""

CLOCK_LEAVES = 0.25
"""Share of the disagreement around changes, in logs of its size, that a shift may leave. Right ones
left 0.08 at most in simulated plants that settle; those of another time, where states do not last
as long as a column is late, 0.45 and more. Origin: assumed, between the two."""
