"""Every number of the proof that decides something: its value, its meaning, its origin.

Origins: *distribution* (a quantile), *source* (a standard or a publication), *measured by* a
command, *numerical* (rounding, convergence: other values give the same answer), *assumed* (chosen
by judgement). Numbers that only lay out text and pictures stand where they are used; how many cases
of which kind are drawn stands in `partition.py`. The simulator in `truth` has its own numbers.
"""

from __future__ import annotations

import math

# Goals -------------------------------------------------------------------------------------------

GOAL_PLACES = 0.95
"""Share of planted effects whose place is in the answer, at least. Origin: assumed."""

GOAL_NAMES = 0.90
"""Share of planted effects that are named rightly, at least. Origin: assumed."""

GOAL_CLEAN = 0.99
"""Share of clean cases that are called clean, at least. Origin: assumed."""

GOAL_UNNAMED = 0.90
"""Share of effects without an entry that are called unnamed, at least. Origin: assumed."""

GOAL_SORTS = 0.95
"""Share of named cases in which fault and sensor are told from physics, at least. Origin:
assumed."""

GOAL_INSIDE = (0.93, 0.97)
"""Share of intervals of 95 % that hold the truth, from and to. Origin: assumed."""

GOAL_FALSE = 0.02
"""Share of false names among all that are told as certain, at most. Origin: assumed."""

GOAL_RATIO = 1.05
"""Held-out error over that of the true model, at most. Origin: assumed."""

GOAL_COURSE = 0.9
"""Correlation of the course of an unrecorded driver with the truth, at least. Origin: assumed."""

GOAL_SOUND, GOAL_FOUND, GOAL_WRONG = 0.95, 0.70, 0.02
"""Of first contacts: share of sound ones that are called so, share of laws of another form that are
named, at least; share of cases with a wrong name that is sure, at most. Origin: assumed."""

BELIEVED = 4.0
"""Standard uncertainties of the sheet within which a parameter that is told lies from the truth.
Origin: distribution: both lie within two of them from the sheet."""

# Scores ------------------------------------------------------------------------------------------

NORMAL_QUANTILE = 1.959963984540054
"""Half the width of an interval of 95 %, in standard deviations. Origin: distribution, normal
quantile of 97.5 %."""

TAILS = (0.025, 0.975)
"""Quantiles of bootstrap samples at the ends of an interval of 95 %. Origin: distribution."""

BOOTSTRAP_SAMPLES = 2000
"""Times that cases are drawn anew for an interval of a mean or median. Origin: numerical."""

COVERAGE_OF_DEGREES = 1.96
"""Half the width of the 95 % interval of a fault's degree, in standard uncertainties: answers state
the uncertainty alone. Origin: distribution, normal quantile of 97.5 %, rounded as in the
mismatch."""

CERTAIN = 0.9
"""Probability of a name from which on the answer tells it alone; below it leaves several open.
Origin: source, the answer's own rule for its verdict `ambiguous`."""

MENTIONED = 0.1
"""Probability of an alternative from which on an answer that leaves several open tells it. Origin:
source, the answer's own rule for its headline."""

TOLD = (0.0, 0.5, 0.7, 0.9, 0.99, 1.0)
"""Ends of the bins of the probabilities that names are told with. Origin: assumed; one end is
CERTAIN."""

FEWEST_IN_A_COURSE = 3
"""Samples of a reconstructed course from which on it is compared with the truth. Origin: numerical,
two points always lie on a line."""

PLAIN_GAIN = 100.0
"""Strength from which on an effect is plain to see: an answer needs a gain of about 15 where it was
not fitted, in four fifths of the samples, beside neighbours that are alike. Origin: assumed."""

PLAIN_MARGIN = 10.0
"""Margin from which on an effect is plain to see: odds of e to the power of 10 (22 000) against the
next name. Origin: assumed."""

# At best -----------------------------------------------------------------------------------------

CANDIDATES = 100
"""Explanations that the best analyst compares. Origin: assumed."""

FALSE_CLAIMS = 0.01
"""Share of clean recordings on which the best analyst claims an effect. Origin: assumed, the
false claims that GOAL_CLEAN allows."""

LOOKED_AT = 0.8
"""Share of the samples that may be looked at; the rest is held out. Origin: assumed, as in the
mismatch, which holds every fifth block out."""

CLAIMED = math.log(CANDIDATES / FALSE_CLAIMS)
"""Gain in log likelihood from which on the best analyst claims an effect. Origin: distribution,
Bonferroni's bound over CANDIDATES likelihood ratios, each above 1/p with probability p at most."""

# Baselines ---------------------------------------------------------------------------------------

CHUNKS = 12
"""Stretches in time into which the samples to learn from are cut for cross-validation. Origin:
assumed."""

FOLDS = 3
"""Folds of the cross-validation, of every third stretch each. Origin: assumed."""

LAGS = (0, 1, 2, 4, 8, 16, 32)
"""Samples by which a column is delayed for boosted trees of plants that store. Origin: assumed."""

SAME = 1e-6
"""Relative difference below which a column is the predicted reading itself. Origin: numerical."""

MOST_TREES = 60
"""Boosted trees at most. Origin: assumed."""

TREE_RATE = 0.1
"""Share of a tree's prediction that is added. Origin: source, default of scikit-learn."""

TREE_LEAVES = 8
"""Leaves of a tree at most. Origin: assumed."""

FEWEST_IN_A_LEAF = 10
"""Samples in a leaf at least. Origin: assumed."""

SPARSE_DEGREE = 2
"""Degree of the polynomials of PySINDy. Origin: assumed."""

SPARSE_RIDGE = 0.05
"""Ridge penalty of its regression. Origin: source, default of PySINDy."""

SPARSE_ROUNDS = 10
"""Rounds of thresholding in a regression at most. Origin: assumed."""

SPARSE_THRESHOLDS = (0.02, 0.1, 0.4)
"""Coefficients below are dropped, of standardised columns for a residual of size 1; which of them
applies is chosen by cross-validation. Origin: assumed."""

MOST_COLUMNS = 12
"""Columns of a law at most: those that correlate best with the residual. Origin: assumed."""

FEWEST_SAMPLES = 30
"""Samples from which on PySINDy learns. Origin: assumed."""

SHORTEST_RUN = 4
"""Samples in a row from which on a map is learnt from them. Origin: assumed."""

RAN_AWAY = 10.0
"""Times the largest residual ever seen beyond which a simulation has run away. Origin: assumed."""

# Second round ------------------------------------------------------------------------------------

USUAL_HOURS = 8.0
"""Hours that an experiment may take where the first recording was shorter. Origin: source, default
of `rulec experiment`."""

SWEEP_HOLD = 10
"""Samples for which a sweep holds each value at least. Origin: assumed, what a settled mean of a
plant of the proof takes."""

TOLD_AT_ALL = 0.02
"""Probability of a set of explanations below which an answer does not tell it. Origin: source, the
answer's own rule for what still stands."""

# Page and processes ------------------------------------------------------------------------------

BINS_PER_DECADE = 2
"""Bins of the strength. Origin: assumed."""

WORST_CASES = 10
"""Worst cases that are listed. Origin: assumed."""

MOSTLY = 0.9
"""Share of right names above a strength from which on the page says that nine of ten are right.
Origin: assumed."""

ENOUGH_CASES = 10
"""Cases above a strength from which on the page says something of them. Origin: assumed."""

INTERRUPT_AGAIN = 0.5
"""Seconds until a process that has lost its lifeline is interrupted again. Origin: assumed."""

PATIENCE = 1800.0
"""Seconds after which a command about a real rig counts as one without an answer. Origin:
assumed."""
