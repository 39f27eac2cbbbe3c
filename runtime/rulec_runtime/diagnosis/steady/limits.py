"""Numbers that decide in settled stretches. Origins as in `rulec_runtime/limits.py`."""

import math

# Memory ----------------------------------------------------------------------------------------

POINTS_AT_ONCE = 1024
"""Settled stretches that are compared with hypotheses at a time. Origin: numerical, what is found
is the same."""

# Probabilities and quantiles -------------------------------------------------------------------

ALARM_PER_RECORDING = 1e-4
"""Probability of a false alarm in a recording of few stretches. Origin: assumed."""

ALARM_PER_STRETCH = 3e-6
"""Probability of a false alarm in a stretch of a long recording. Origin: assumed."""

DISAGREE = 2.0
"""Normal quantile of chi-square beyond which the stretches of a run disagree more than they should,
so that bounds are widened. Origin: distribution, normal quantile of 97.7 %."""

# Settled stretches -----------------------------------------------------------------------------

FEWEST_EVENTS = 3
"""Times that something comes and goes before it is told. Origin: assumed, twice may be chance."""

LONGEST_EVENT = 10
"""Samples between two settled stretches at most that count as an event: what lasts longer settles.
Origin: assumed."""

LEAST_EVENT = 2.0
"""Samples that a single reading must be off each time, on average: else it glitches. Origin:
assumed."""

# Sensor health: a reading against the others -----------------------------------------------------

TRIED_FROM, TRIED_TO = 0.05, 3.0
"""Ends of the values tried, in references, where a sensor has no range. Origin: assumed."""

STAND_IN_VALUES = 15
"""Values tried for a reading that was taken out, between the ends of its range. Origin: numerical,
each stands for all as near to it as to the next one."""

STAND_INS = 60
"""Stretches in which a value stands in for a reading that was taken out, spread evenly over all of
them. Origin: assumed, what a finding needs; each costs as much as a hundred others."""

STAND_INS_REFINED = 2
"""Of the values tried those whose neighbours are tried next. Origin: numerical."""

STAND_IN_ROUNDS = 3
"""Times that neighbours are tried, each time three times closer: in the end a thousandth of the
range. Origin: numerical, the equations are straight enough from there."""

STAND_IN_SPREAD = 0.3
"""Standard uncertainty of a value that stands in for a reading, as a share of the range: that of
any value in it being as likely (the range over the root of 12). Origin: distribution, uniform."""

# Estimates of a flow and what is usable ----------------------------------------------------------

HALF_PRESENT = 0.5
"""Share of the samples of a stretch, less one, in which a reading must be there: one that comes
with every second sample is. Origin: assumed."""

NULL_SPACE = 1e-10
"""Singular value, over the largest, below which it counts as zero. Origin: numerical."""

RIDGE, RIDGE_OF_INFORMATION = 1e-12, 1e-14
"""Ridge of a covariance, and of an information matrix, relative to its trace, that keeps it
regular. Origin: numerical."""

# Baseline --------------------------------------------------------------------------------------

WORTH_LEARNING = 0.02
"""Information (nat) per residual below which a further stretch is not worth learning. Origin:
assumed."""

ROUNDED_OTHERWISE = 1.0 + 1e-9
"""Factor by which the least that a fault may leave may differ from what its fit leaves. Origin:
numerical."""

LASTING = 6.0 * 3600.0
"""Time, s, over which lasting errors lose their memory. Origin: assumed, a quarter of the daily
cycle of ambient temperature, which moves most of them."""

# Courses of a degree ------------------------------------------------------------------------------

POINTS_OF_A_COURSE = 48
"""Stretches that one course has to explain, of more some, evenly. Origin: assumed."""

POINTS_THAT_GROW = 6
"""Stretches below which no growth is looked for. Origin: assumed; a line has two parameters, and as
many again tell whether it is one."""

USUAL_DEGREE = 0.3
"""Degree of usual size, of a share, or of the range of a sensor. Origin: assumed; as the usual
sizes of leakage and clogging in kb/faults."""

VISITED = 4
"""Operating points kept of a plant-day. Origin: assumed; a month has more than a course needs."""

BENDS_OF_A_COURSE = 5
"""Times at which the growth of a degree may change. Origin: numerical; more give the same."""

ONSETS_AT_FIRST = 8
"""Every which stretch is tried as the first one with a fault, before its course is worked out.
Origin: numerical; growth that began between two of them is seen as well."""

POINTS_OF_A_STEP = 3
"""Stretches per step at least. Origin: assumed; with fewer, steps would go through all of them."""

STEPS_OF_A_COURSE = 8
"""Steps at most that growth is compared with. Origin: numerical; the rest is told by runs."""

BENDING = (0.0, 0.1, 0.5, 2.0)
"""By how much growth may change on its way, over growth that leads to a usual degree. Origin:
assumed; each way is as likely, and counts by its evidence."""

DRIFT_TIMES = ((LASTING, 0.125), (7.0 * 86400.0, 0.125), (90.0 * 86400.0, 0.25), (math.inf, 0.5))
"""Times, s, over which parts of the variance of lasting errors lose their memory, and these parts,
where degrees are followed over hours or months: the day, the week, the season, and what never
changes. Origin: assumed; the bound of a sensor's class holds its calibration, which stays, and as
much again that drifts, on every scale of time."""

COURSE_CONVERGED = 1e-4
"""Change of a degree, of its scale, at which its course has been found. Origin: numerical."""

SOONEST, LATEST, TIMES_AHEAD = 1e-3, 30.0, 400
"""Times between which a degree is looked at ahead, over that for which it has grown, and how many
of them. Origin: numerical; nobody plans further ahead."""

STEPS_THAT_GROW = 2
"""Steps up from which on a fault is told to grow. Origin: assumed."""

COURSES_TRIED = 4
"""Faults whose courses are worked out, besides those that are named and those that explain as much:
those that explain most to first order. Origin: assumed."""

TIED = 1e-6
"""Difference of gains, nats, within which faults explain as much. Origin: numerical."""

PARTS_OF_A_COURSE = 3
"""Degrees of freedom of a course: where it begins, how large it is and how fast it grows. Origin:
distribution."""

GROWS = math.log(20.0)
"""Evidence of growth over steps from which on a fault is told to grow. Origin: assumed, strong
evidence (Kass and Raftery 1995)."""

# Test of a hypothesis ----------------------------------------------------------------------------

TABLE = 1_000_000
"""Numbers in a table that is worked on at once: it stays in the cache, and memory flat. Origin:
numerical."""

MANY_RESIDUALS = 128
"""Residuals of an operating point from which on stretches are stacked in those combinations alone
that show the faults in question. Origin: numerical; below that it costs less to stack all."""

ROWS_OF_A_FAULT = 16
"""Combinations of estimates at most of the mean of stretches, and of their differences, by which
they tell of one fault in a plant with `MANY_RESIDUALS`. Origin: numerical; a fault of a module
moves up to three estimates, and of those that move hundreds the others add next to nothing."""

ROWS_TOGETHER = 64
"""The same of faults that are compared with each other. Origin: numerical."""

GAIN_AT_FIRST = 0.1
"""Share of what the best listed fault lowers chi-square by which an unlisted one lowers it at least
to first order in its degree, if it is to be tried. Origin: assumed; readings act nearly in
proportion to their errors, so the first order is nearly all."""

ORDINARY_KELVIN = 10.0
"""Kelvin by which a liquid may be warmer or colder than when its plant was calibrated, without that
being a finding. Origin: assumed; halls over a year, tanks over a day."""

LIQUID_AT_FIRST = 0.5
"""Share of what is left to explain of chi-square by which a change of the liquid lowers it at least
to first order in its degree, if it is to be tried. Origin: assumed; its laws are powers, so that
the first order points where it leads, and the tolerance of its laws does the rest."""

NAMED_ALONE = 0.5
"""Probability from which on a stretch names a fault on its own. Origin: standard (more probable
than all others together)."""

IMPROBABLE = 1e-6
"""Probability, relative to the best, below which a course of a degree does not count. Origin:
numerical; alternatives are mentioned from `MENTION` on."""

IMPROBABLE_THROUGHOUT = 1e-3
"""Probability in every stretch of a run below which a fault is not compared in all of them
together, in such a plant. Origin: numerical; alternatives are mentioned from `MENTION` on."""

SAME_ROWS = 1e-6
"""Relative size below which a combination of estimates says nothing new. Origin: numerical."""

ESTIMATES_AT_ONCE = 1_000_000
"""Numbers in the covariances of estimates of points that are worked on together, in such a plant.
Origin: numerical, what is found is the same."""

FIT_STEPS = 15
"""Gauss-Newton steps at most; a step that leads away is halved, and counts. Origin: numerical."""

FIT_CONVERGED = 1e-9
"""Change of a degree below which it stands. Origin: numerical."""

FIT_STARTS = (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.97, 1.5, 2.5, 5.0, 10.0)
"""Degrees tried first: far from its start Gauss-Newton may run into a pole of the law. Origin:
numerical."""

PAIR_STARTS = (0.1, 0.3)
"""Degrees of each of two faults tried first. Origin: numerical."""

SHEET_ERROR = 8.0
"""Standard uncertainties that a parameter of a sheet may be off. Origin: distribution (Student with
three degrees of freedom, as sheets are believed; two-sided, 0.4 %)."""

OFF_SHEET = (2.0, 0.139), (4.0, 0.028), (8.0, 0.004)
"""Standard uncertainties that laws may be off their sheet, with the probability of as much. Origin:
distribution (Student with three degrees of freedom, two-sided)."""

SPAN_OF_A_FORM = 4.0
"""Uncertainties of a reading that it must span before a law's form may follow it. Origin:
distribution (normal, what noise spans)."""

LARGEST_SCALE = 10.0
"""Factor on the errors of an estimate at most: near the pole of a law all is lost anyway. Origin:
assumed."""

DEGREES_APART = 1e-4
"""Determinant of the information over its diagonal below which two degrees are not told apart.
Origin: numerical."""

PAIRS_SCREENED = 12
"""Pairs of faults per point that pass the linear screening. Origin: assumed."""

EVIDENCE_DECIMALS = 8
"""Decimals of log-likelihoods: hypotheses that differ by less explain a point alike, and not
rounding but their order in the ruleset says which one is named. Origin: numerical."""

# Stretches joined to findings --------------------------------------------------------------------

FAR_BEYOND = 10.0
"""A deviation this many times beyond the threshold of an alarm (in chi-square) need not persist.
Origin: assumed."""

JOINS_A_RUN = 0.05
"""A cause more probable than this in every stretch holds a run together. Origin: assumed."""

STRETCHES_COMPARED = 8
"""Stretches of a run that a new one is compared with. Origin: assumed."""

STACKED = 8
"""Stretches that are stacked of a run, and of its baseline, spread over their length. Origin:
assumed."""

PAIR_CANDIDATE = 0.02
"""Probability in some stretch from which on a fault is a candidate for a pair. Origin: assumed."""

TRIED_AT_OTHER_TIMES = 3
"""Faults tried as being there at other times: those that explain most to first order. Origin:
assumed."""

FOUND_BEFORE = math.log(10.0)
"""Advantage, as a log-likelihood, of a pair that holds a fault found just before: a known fault
rarely goes by itself. Origin: assumed."""

FAULT_FROM_START = -math.log(20.0)
"""Advantage, as a log-likelihood, of a fault that was there from the start, too small to be seen:
recordings that begin with a sound plant are the rule. Origin: assumed."""

RIVAL = 1.0 / 3.0
"""A cause at least this probable, relative to the named one, is an alternative to it. Origin:
assumed."""

MENTION = 0.02
"""Causes less probable than this are not mentioned. Origin: assumed."""

ALIKE = 0.8
"""Share of the likelihood of a cause from which on a reading's error that no module lists stands
beside it, however seldom it comes: no reading speaks against either. Origin: assumed."""

SECOND_FAULT = math.log(100.0)
"""Advantage, as a log-likelihood, that two faults at once need over a change of the liquid alone.
Origin: assumed; two steps of `FREQUENCY_ODDS`, as a second fault is a coincidence."""

BY_TEMPERATURE = math.log(10.0)
"""Advantage, as a log-likelihood, of a change of the liquid where recorded temperatures moved as it
needs; as large a disadvantage where they did not. Origin: assumed, a step of `FREQUENCY_ODDS`."""

SAME_TEMPERATURE = 0.5
"""Kelvin within which a temperature is told to have stayed where it was. Origin: assumed."""

AS_GOOD = 0.5
"""Share of the likelihood of the best listed fault that an error which no module lists has in
some stretch, to be tried on the run: less than `ALIKE`, as noise moves both. Origin: assumed."""

DITHERED = 2.0
"""Steps of a display per standard deviation of noise. Below it, noise averages rounding out: the
mean of many readings is wrong by less than 0.003 steps. Origin: numerical."""

ROUNDED_LEVELS = 10
"""Fewest levels of a display: fewer even ones may be set points, unless all are decimals of a few
places. Origin: assumed."""
