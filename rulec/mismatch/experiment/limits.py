"""Every number that decides in the planning of experiments, with its origin."""

from __future__ import annotations

# Displays with coarse steps.

CORNERED = 4
"""Inputs of which the ends are combined in all ways. Origin: numerical."""

PLACES_DOUBLED = 7
"""Doublings of the number of operating points that are tried. Origin: numerical."""

HELD_SAMPLES = 10
"""Settled samples of a step of an experiment at least. Origin: assumed."""

SHORTEST_STEP = 60.0
"""How long a step lasts where a recording does not tell, s. Origin: assumed."""

WORTH_A_STEP = 0.002
"""By how much a step must raise the probability of the truth. Origin: numerical."""

WORTH_DOUBLED = 0.01
"""By how much the probability of the truth must rise where all steps are held twice as long.
Origin: assumed."""

MOST_QUADRUPLED = 8
"""Times that a step is held four times as long as before, where that is tried: to four hours if it
takes a second at least. Origin: numerical."""

SCATTER_NODES = 5
"""Values of a deviate over which the probability of the truth is averaged. Origin: numerical."""

TELLING_STEPS = 6
"""Most steps of an experiment that tell explanations apart; all others cover what may be set.
Origin: assumed."""

COVERING_HELD = 4
"""How many times as long as readings take to settle a step that covers what may be set is held.
Origin: assumed."""

TOLD_APART = 3.0
"""Expected log Bayes factor from which on two explanations are told apart, nats: 20 to 1. Origin:
source (Kass and Raftery 1995, strong evidence)."""

READINGS_TOLD = 2
"""Readings that are told of each step of an experiment. Origin: assumed."""

STEPS_DRAWN = 2
"""Steps of which the terminal draws what is foretold. Origin: assumed."""

FORETELL_STEPS = 8
"""Steps in which readings are found that obey a model. Origin: numerical."""

FORETELL_STEP = 0.5
"""Largest share by which a reading moves in a step. Origin: numerical."""

FORETOLD_WELL = 0.01
"""By how much readings that are foretold may miss the model that foretells them, in units of the
noise. Origin: numerical."""

COVERED = 2.0
"""Standard deviations of what is foretold that must stay within the limits of a reading. Origin:
standard (coverage factor of an expanded uncertainty, JCGM 100:2008)."""

CLAIM_STEP = 0.1
"""Step of a number, in its standard deviations, in which the slope of what an explanation says is
taken. Origin: numerical."""

WORTH_PRODUCT = 0.01
"""Probability of the truth that is given up rather than product. Origin: assumed."""
