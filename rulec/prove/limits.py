"""Every number that decides something in the proof: its value, its meaning, its origin.

Origins: *distribution* (a quantile), *source* (a standard or a publication), *measured by* a
command, *numerical* (rounding, convergence: other values give the same answer), *assumed* (chosen
by judgement). Numbers that only lay out text and pictures are where they are used; the numbers of
cases are in `partition.py`. The simulator in `truth` has its own numbers.
"""

from collections.abc import Mapping

# Goals -------------------------------------------------------------------------------------------

GOALS: Mapping[str, tuple[float, float]] = {
    # Of planted effects: the place is in the answer; the name is right
    "place_right": (0.95, 1.0),
    "name_right": (0.90, 1.0),
    # Of clean cases: reported clean. Of effects without an entry: reported unnamed
    "clean_right": (0.99, 1.0),
    "unnamed_right": (0.90, 1.0),
    # Of named cases: faults and sensor errors are distinguished from physics
    "told_right": (0.95, 1.0),
    # Of 95 % intervals: the truth is inside. Of names that are reported as certain: false
    "inside": (0.93, 0.97),
    "false": (0.0, 0.02),
}
"""Least and largest value of each score that is good enough. Origin: assumed."""

# Scores ------------------------------------------------------------------------------------------

NORMAL_QUANTILE = 1.959963984540054
"""Half the width of an interval of 95 %, in standard deviations. Origin: distribution, normal
quantile of 97.5 %."""

TAILS = (0.025, 0.975)
"""Quantiles of bootstrap samples at the ends of an interval of 95 %. Origin: distribution."""

BOOTSTRAP_SAMPLES = 2000
"""Resamples of the cases for an interval of a mean or median. Origin: numerical."""

COVERAGE_OF_DEGREES = 1.96
"""Half the width of the 95 % interval of a fault's degree, in standard uncertainties, as answers
state the uncertainty only. Origin: distribution, normal quantile of 97.5 %, rounded as in the
mismatch."""

CERTAIN = 0.9
"""Probability above which an answer reports a name alone; below, it leaves several open. Origin:
source, the answer's own rule for its verdict `ambiguous`."""

MENTIONED = 0.1
"""Least probability of an alternative that an ambiguous answer reports. Origin: source, the
answer's own rule for its headline."""

PROBABILITIES = (0.0, 0.5, 0.7, 0.9, 0.99, 1.0)
"""Edges of the bins of probabilities with which names are reported. Origin: assumed; CERTAIN is
one of them."""

# Second round ------------------------------------------------------------------------------------

USUAL_HOURS = 8.0
"""Hours that an experiment may take if the first recording was shorter. Origin: source, default of
`rulec experiment`."""

# Page and processes ------------------------------------------------------------------------------

WORST_CASES = 10
"""Worst cases that are listed. Origin: assumed."""

PATIENCE = 1800.0
"""Seconds after which a command on a real rig counts as unanswered. Origin: assumed."""
