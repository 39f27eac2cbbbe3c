"""Every number of the runtime that decides something: its value, its meaning, its origin.

Origins: *distribution* (a quantile), *source* (a standard or a publication), *measured by* a
command, *numerical* (rounding, convergence: other values give the same answer), *assumed* (chosen
by judgement). Numbers that only lay out text and pictures stand where they are used.
"""

# Probabilities and quantiles -------------------------------------------------------------------

COVERAGE = 2.0
"""Half the width of an interval of 95 %, in standard uncertainties. Origin: distribution, normal
quantile of 97.5 % (1.96), rounded as in the GUM."""

THRESHOLD = 3.0
"""A residual counts as non-zero beyond this many standard uncertainties: in the detectable degrees
of the matrix and in the evidence of a finding alike. Mode `paper` has `COVERAGE` in its place, as
the seed paper does. Origin: distribution, normal quantile of 99.87
%."""

NORMAL_SPREAD = 1.4826
"""Standard deviation over the median of absolute values. Origin: distribution, 1 over the normal
quantile of 75 %."""

CALM = 2.0
"""Normal quantile of chi-square up to which a stretch counts as fault-free enough to learn from.
Origin: distribution, normal quantile of 97.7 %."""

# Reading files ---------------------------------------------------------------------------------

LARGEST_FILE = 2**38
"""Bytes of any file at most. Origin: assumed; a year of 100 signals at 1 kHz, packed."""

LARGEST_JSON = 2**30
"""Bytes of a file of JSON at most. Origin: assumed, far above the ruleset of 1000 modules."""

SHOWING_ROWS = 200
"""Rows at the begin of a file that show how it writes numbers and dates. Origin: assumed."""

MOST_DIGITS = 20
"""Digits of a whole number in JSON at most. Origin: numerical, a double holds 17."""

ABSURD = 1e15
"""Absolute value, SI, beyond which a number is a fill value of some program and not a reading.
Origin: assumed."""

PAUSE = 3.0
"""A pause longer than this many sampling intervals ends a settled stretch. Origin: assumed."""

# Settled stretches -----------------------------------------------------------------------------

SHORTEST_STRETCH = 3
"""Samples of a settled stretch at least. Origin: assumed."""

LONGEST_STRETCH = 60
"""Samples after which a stretch is cut, so that slow change is followed. Origin: assumed."""

NO_CHANGE = 0.1
"""Share of a sensor's systematic uncertainty below which a change is none, however small the noise.
Origin: assumed."""

JUMP = 6.0
"""A jump exceeds the noise of a difference by this factor. Origin: assumed."""

PERSISTENCE = 5
"""Samples over which a finding must hold: shorter ones are mostly the end of a transient. Origin:
assumed."""

SETTLING = 5
"""Samples behind a jump at most that are left out because a reading still settles. Origin:
assumed."""

# Slow motion -----------------------------------------------------------------------------------

TOO_FAST = 0.1
"""Share of a flow by which lags may be wrong for its estimate to be used: beyond, first order no
longer holds. Origin: assumed; the second order is then a few thousandths."""

TOO_VAGUE = 0.3
"""Share of a flow by which its parameters may leave it uncertain (standard uncertainty) for its
estimate to be judged: beyond, first order no longer holds. Origin: distribution (of a reciprocal,
the second order is then a tenth)."""

# Sensor health: a reading by itself ------------------------------------------------------------

NEVER_MOVED = 20
"""Equal samples from which on a reading that never moved is judged. Origin: assumed."""

BEYOND_RANGE = 0.02
"""Share of its range by which a reading may leave it and still be used. Origin: assumed."""

NEAREST_ESTIMATES = 24
"""Estimates from which on it is asked of those nearest to a module alone which of its faults can be
seen. Origin: assumed; as many as the largest plant that is shipped has, and what is farther away
says next to nothing."""

SETS_TRIED = 128
"""Sets of lost readings of one size that are tried for the smallest that brings a fault back.
Origin: numerical; of more, a set is taken of which all are needed."""

# Sensor health: a reading against the others -----------------------------------------------------

STRETCHES_LOOKED_AT = 60
"""Stretches in which readings are compared; of longer recordings some, evenly. Origin: assumed."""

NEARLY_ALL = 0.9
"""Share of stretches in which a hypothesis about a reading must hold. Origin: assumed."""

# Estimates of a flow and what is usable ----------------------------------------------------------

BEYOND_CALIBRATED = 0.1
"""Share of the calibrated range by which readings may leave it. Origin: assumed."""

LINKED = 1e-9
"""Share of an estimate in another's redundancy above which both belong to one block. Origin:
numerical."""

LEAST_U = 1e-12
"""Standard uncertainty of a degree at least, where it weights a mean. Origin: numerical."""

# Test of a hypothesis ----------------------------------------------------------------------------

UNTOUCHED = 1e-6
"""Share of a fault's own effect below which residuals count as untouched (it cancels). Origin:
numerical."""

PLANS_CACHED = 512
"""Parts of a plan, as those of hypotheses tried together, that are kept for the next time. Origin:
numerical."""

BELOW_HIGHEST = 1e-6
"""Share of its highest degree by which a fit stays below it: there a law has its pole. Origin:
numerical."""

END_OF_RANGE = 1e-3
"""Share of its highest degree within which a fit counts as at the end of its range. Origin:
numerical."""

# Stretches joined to findings --------------------------------------------------------------------

SAME_DEGREE = 0.1
"""Relative change of a degree, beyond its scatter, that still counts as the same fault. Origin:
assumed."""

UNLISTED_ODDS = 0.1
"""Prior odds of an error of a reading that no module lists, over a listed fault of the same word.
Origin: assumed; who describes a module lists what comes in it."""

HEADLINE_RIVAL = 0.2
"""Alternatives more probable than this stand in the headline. Origin: assumed."""

# Exit codes --------------------------------------------------------------------------------------

NOT_ALL_JUDGED = 3
"""Exit code of `diagnose` where nothing was judged, or faults that could be seen were not, because
readings are not there. Origin: assumed, as `--fail-on` of `watch` has it; 1 and 2 are mistakes."""

# Stories kept as text -----------------------------------------------------------------------------

STORY_WIDTH = 100
"""Characters of a line where no terminal sets them. Origin: assumed."""

# Progress ----------------------------------------------------------------------------------------

SHOWN_AFTER = 2.0
"""Seconds after which a terminal shows what is being done: shorter waits need no bar. Origin:
assumed."""

DRAWN_EVERY = 0.25
"""Seconds between two pictures of the bar. Origin: assumed."""

LINE_EVERY = 10.0
"""Seconds between two lines of progress where nobody sees a bar, as in a log. Origin: assumed."""

# Simulation --------------------------------------------------------------------------------------

STATISTICAL_SHARE = 0.3
"""Standard deviation of the statistical error of a simulated sensor, as a share of the systematic
standard uncertainty. Origin: assumed, the seed paper publishes systematic bounds only."""

# What is kept for the next start ----------------------------------------------------------------

MOST_CACHED_BYTES = 400_000_000
"""Bytes of all compiled plants that are kept; beyond it the oldest go. A plant of abc's size takes
0.1 MB. Origin: assumed."""
