"""Every number of the runtime that decides something: its value, its meaning, its origin.

Origins: *distribution* (a quantile), *source* (a standard or a publication), *measured by* a
command, *numerical* (rounding, convergence: other values give the same answer), *assumed* (chosen
by judgement). Numbers that only lay out text and pictures stand where they are used.
"""

from __future__ import annotations

import math

# Memory ----------------------------------------------------------------------------------------

IN_MEMORY = 8 * 2**20
"""Bytes of arrays made together up to which they stay in memory; larger ones lie in a file. Origin:
numerical, what is found is the same."""

PIECE = 2**20
"""Bytes of a file that are read at a time. Origin: numerical, what is read is the same."""

PARQUET_ROWS = 2**16
"""Rows of a Parquet file that are read at a time. Origin: numerical, what is read is the same."""

PARQUET_BUFFER = 2**17
"""Bytes of each column of a Parquet file that are read at a time. Origin: numerical, what is read
is the same."""

ALIGNED = 64
"""Bytes at whose multiples arrays in a file begin, as in memory. Origin: numerical."""

MARKED_AT_ONCE = 4096
"""Stretches that are marked before memory is let go. Origin: numerical."""

GATHERED_AT_ONCE = 64
"""Points anywhere in a table that are read before memory is let go. Origin: numerical."""

COUNTED_BITS = 16
"""Leading bits by which numbers are counted to find their median. Origin: numerical, the median is
the same."""

BLOCK = 2**17
"""Samples that a pass over a column takes at a time. Origin: numerical, what is found is the
same."""

SORTED_AT_ONCE = 2**19
"""Numbers whose median is found by sorting them; of more by a sample, or by counting. Origin:
numerical, the median is the same."""

SAMPLED = 251
"""Numbers of which one is taken into the sample that tells where a median is. Origin: numerical,
the median is the same; a prime, so that nothing repeats with it."""

MEDIAN_WITHIN = 4.0
"""Standard deviations of the rank of a median in a sample, within which it is looked for. Origin:
numerical, the median is the same."""

RUNS_AT_ONCE = 256
"""Runs of stretches whose hypotheses are held at a time. Origin: numerical, what is found is the
same."""

TRIED_AT_ONCE = 64
"""Settled stretches, over all ways to read columns, that are compared at a time. Origin: numerical,
what is found is the same."""

POINTS_AT_ONCE = 1024
"""Settled stretches that are compared with hypotheses at a time. Origin: numerical, what is found
is the same."""

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

ALARM_PER_RECORDING = 1e-4
"""Probability of a false alarm in a recording of few stretches. Origin: assumed."""

ALARM_PER_STRETCH = 3e-6
"""Probability of a false alarm in a stretch of a long recording. Origin: assumed."""

CALM = 2.0
"""Normal quantile of chi-square up to which a stretch counts as fault-free enough to learn from.
Origin: distribution, normal quantile of 97.7 %."""

DISAGREE = 2.0
"""Normal quantile of chi-square beyond which the stretches of a run disagree more than they should,
so that bounds are widened. Origin: distribution, normal quantile of 97.7 %."""

# Reading files ---------------------------------------------------------------------------------

LARGEST_FILE = 2**38
"""Bytes of any file at most. Origin: assumed; a year of 100 signals at 1 kHz, packed."""

LARGEST_JSON = 2**30
"""Bytes of a file of JSON at most. Origin: assumed, far above the ruleset of 1000 modules."""

LARGEST_PIPE = 2**30
"""Bytes from standard input at most, which stay in memory. Origin: assumed; longer ones can be kept
in a file, which need not stay there."""

LONGEST_LINE = 2**24
"""Bytes of a line of a CSV file at most. Origin: assumed; 50 000 numbers need a megabyte."""

MOST_COLUMNS = 50_000
"""Columns of a table at most. Origin: assumed; the largest plants have some thousand signals."""

LONGEST_UNIT = 40
"""Characters of a unit at most. Origin: assumed."""

LARGEST_POWER = 6
"""Exponent of a unit at most. Origin: assumed."""

FREE_TO_UNPACK = 100_000_000
"""Bytes that any packed recording may unpack to. Origin: assumed; 300 MB take a second."""

DENSEST = 100
"""Times its own size that a packed recording may unpack to. Origin: assumed; recordings pack to
between a third and a twentieth."""

LINES_ABOVE_TITLES = 60
"""Lines above the titles of a table at most: what a logger tells of itself. Origin: assumed."""

MOST_PLACES = 10_000
"""Groups and data sets of a file at most that are looked at. Origin: assumed; loggers write some
thousand channels."""

MOST_IN_TREE = 20
"""Levels of groups or structures in a file at most. Origin: assumed."""

GOOD_QUALITY = 192
"""Quality of a reading in a historian from which on it is good. Origin: standard, OPC Data Access:
the upper two of its eight bits are set."""

SHOWING_ROWS = 200
"""Rows at the begin of a file that show how it writes numbers and dates. Origin: assumed."""

FEW_TEXTS = 10_000
"""Different texts of a column of which one copy each is kept. Origin: numerical."""

COLUMNS_OF_LONG = 10
"""Columns at most of a table that has a reading a row, where no column map says so. Origin:
assumed, those of historians have four to eight."""

LONGEST_DATE = 64
"""Characters of a date at most. Origin: assumed, twice those of the longest."""

LAST_CENTURY = 69
"""Two digits from which on they are a year of the last century. Origin: standard, POSIX strptime.
"""

FIRST_YEAR, LAST_YEAR = 2000, 2060
"""Years between which numbers are looked at as dates: as Unix time in any unit, days of a
spreadsheet, and their like. Origin: assumed, the time of digital recordings."""

BRIEFEST_ROW = 1e-3
"""Seconds from row to row below which days of a spreadsheet are meant: no logger of a plant writes
so fast. Origin: assumed."""

LONGEST_OF_SECONDS = 0.1
"""Seconds from row to row up to which nobody knows whether days or seconds are meant: a day has
2.4 hours in 0.1. Origin: assumed."""

SHARE_ON_CHANGE = 0.5
"""Share of rows with a reading from which on nobody asks whether it is written when it changes.
Origin: assumed."""

SHARE_REGULAR = 0.8
"""Share of distances between readings that are alike, from which on a slow reading is a sampled
one. Origin: assumed."""

ROWS_ON_CHANGE = 10
"""Rows from which on one or two readings are too few for a slow one. Origin: assumed."""

MOST_DIGITS = 20
"""Digits of a whole number in JSON at most. Origin: numerical, a double holds 17."""

ABSURD = 1e15
"""Absolute value, SI, beyond which a number is a fill value of some program and not a reading.
Origin: assumed."""

BEYOND_SENSOR = 1e6
"""Times the reference reading and the range of its sensor beyond which a number is no reading.
Origin: assumed; no sensor spans six decades above what its plant runs at."""

ROWS_PER_STEP_BACK = 20
"""Rows per step back in time, on average, below which rows are out of order and no clock was set.
Origin: assumed."""

WRITTEN_TWICE = 3
"""Rows on both sides of a step back with the same times, from which on a clock was set: two rows
alone may have changed places. Origin: assumed."""

CLOCK_LOST = 10.0
"""A step back by this many times what was recorded is a clock that lost its time, not a block of
rows written late. Origin: assumed."""

CLOCK_STOOD = 20
"""Rows in a row with the very same time from which on a clock stood still; fewer are a fast logger.
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

FEWEST_EVENTS = 3
"""Times that something comes and goes before it is told. Origin: assumed, twice may be chance."""

LONGEST_EVENT = 10
"""Samples between two settled stretches at most that count as an event: what lasts longer settles.
Origin: assumed."""

LEAST_EVENT = 2.0
"""Samples that a single reading must be off each time, on average: else it glitches. Origin:
assumed."""

SETTLING = 5
"""Samples behind a jump at most that are left out because a reading still settles. Origin:
assumed."""

SETTLED = 4.0
"""A reading has settled when it differs from the next few, its drift apart, by this many times its
noise or less. Origin: assumed."""

# Slow motion -----------------------------------------------------------------------------------

USUAL_LAG = 1.0
"""Standard uncertainty of the lag of a reading behind the others, s: the response of its sensor and
the damping set in its transmitter. Origin: assumed; transmitters and converters of process plants
are mostly damped by some tenths of a second to two seconds."""

AGE_OF_SAMPLE = 12.0**-0.5
"""Standard uncertainty of the age of a logged reading, in sampling intervals: it is up to one
interval old. Origin: distribution, rectangular (GUM 4.3.7)."""

SEEN_BETWEEN = 5.0
"""Time between samples up to which slow motion is judged, s. What comes and goes between two
samples, as a pump that ran for a part of the time, looks like slow motion and is none. Origin:
assumed."""

LONGEST_SLOW = 5
"""Samples of a piece of slow motion, roughly: over more of them laws are not straight. Origin:
assumed."""

TOO_FAST = 0.1
"""Share of a flow by which lags may be wrong for its estimate to be used: beyond, first order no
longer holds. Origin: assumed; the second order is then a few thousandths."""

# Tables of operating points --------------------------------------------------------------------

MOVING_ROWS = 3.0
"""Median change from row to row, in standard uncertainties of the sensor, of a reading on the move.
Origin: assumed."""

MOVING_READINGS = 2
"""Readings that must be on the move for a table of points: one alone may be a noisy sensor. Origin:
assumed."""

FEWEST_POINTS = 4
"""Rows below which it is not asked whether they are a table of points. Origin: assumed."""

USUAL_CHANGES = 0.99
"""Share of changes from row to row that count as usual: the rest may be a start or a stop. Origin:
assumed."""

LEAP = 1.0
"""Standard deviations of a reading that it never leaps by in a run. Origin: assumed; a ramp of the
independent truth leaps by 0.15 at most, the flow in six tables of pump curves by 3.1 to 3.4."""

# Noise and display of a reading ----------------------------------------------------------------

FEWEST_FOR_CORRELATION = 8
"""Samples below which errors count as independent. Origin: assumed."""

LONGEST_CORRELATION = 0.1
"""Correlation length as a share of the samples at most: no recording shows more. Origin:
assumed."""

WHITE_CORRELATION = 2.0
"""Autocorrelation, times the root of the number of samples, below which it counts as none. Origin:
distribution, 95 % of those of white noise (Bartlett 1946)."""

GLITCH = 8.0
"""A single reading that is this many times the usual step away from both neighbours is none.
Origin: assumed."""

LEAST_USUAL_STEP = 0.02
"""Usual step of a reading at least, as a share of its standard deviation. Origin: assumed."""

FINEST_STEPS = 0.05
"""Share of the steps between levels that are finer than what counts as the least. Origin:
assumed."""

COARSEST_RESOLUTION = 0.05
"""Resolution of a reading as a share of its standard deviation at most. Origin: assumed."""

FINEST_RESOLUTION = 1e-4
"""Resolution of a reading as a share of its standard deviation at least. Origin: assumed."""

SAME_LEVEL = 1e-9
"""Share of its unit and range by which two levels of a reading must differ. Origin: numerical."""

LEAST_NOISE = 1e-300
"""Keeps divisions by the noise of a reading that has none. Origin: numerical."""

# Sensor health: a reading by itself ------------------------------------------------------------

STILL_RUN = 10
"""Equal readings in a row that may be stuck. Origin: assumed."""

STILL_TIMES = 5.0
"""Times the longest chance run that a stuck reading stands still for. Origin: assumed."""

RESTLESS = 0.7
"""Scatter of third differences, in least steps, from which on a reading has noise of its own (a
smooth course that is rounded has a third); and noise by fourth differences over that by third ones
(equal for noise, next to none for a smooth course). Origin: assumed."""

REPEATED = 0.5
"""Share of readings that repeat the one before, from which on a display is too coarse, or a value
is held too often, for standing still to mean anything: at less, 45 in a row are no chance. Origin:
assumed."""

INSTRUMENT_NOISE = 3.0
"""Noise of an instrument at most, in standard uncertainties of its class: a value that is set moves
by more where it moves, and not at all where it is held. Origin: assumed."""

NEVER_MOVED = 20
"""Equal samples from which on a reading that never moved is judged. Origin: assumed."""

WRITTEN_DIGIT = 1e-6
"""Share of a step by which a number may miss a multiple of it and still be written in it. Origin:
numerical."""

FAILED_BELOW = 0.025
"""Share of its range by which a reading of 3.6 mA lies below it. Origin: source, NAMUR NE 43."""

FAILED_ABOVE = 0.0625
"""Share of its range by which a reading of 21 mA lies above it. Origin: source, NAMUR NE 43."""

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

AT_ZERO = 0.01
"""Share of its range, or of its reference, within which a reading is at zero. Origin: assumed."""

DIES = 2
"""Times at most that a reading dies: a loose contact, not the cycle of a plant. Origin: assumed."""

FLOWS_BEYOND = 10.0
"""Standard uncertainties beyond which a flow is there. Origin: assumed."""

FLOWS_PART = 0.1
"""Share of its reference beyond which a flow is there. Origin: assumed."""

LEVEL_THERE = 0.25
"""Share of its range that a level must stand above its end, by the balances, to be there for sure:
they are nominal, and a start is not known. Origin: assumed."""

FREED_VALUES = 41
"""Values of a freed reading tried between the ends of its range. Origin: numerical."""

FREED_ROUNDS = 4
"""Times that the neighbours of the best value are tried, each time four times closer. Origin:
numerical."""

FREED_FROM = 0.05
"""Low end of the values tried, in references, where a sensor has no range. Origin: assumed."""

FREED_TO = 3.0
"""High end of the values tried, in references, where a sensor has no range. Origin: assumed."""

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

SHOULD_MOVE = 6.0
"""Standard uncertainties by which the value that suits the others must move. Origin: assumed."""

SHOULD_MOVE_STORES = 20.0
"""Standard uncertainties by which balances must move a reading that does not. Origin: assumed."""

SHOULD_MOVE_DIGITS = 3.0
"""Steps of its last digit by which a reading should move at least, to be frozen when it does not.
Origin: assumed."""

FINE_DIGIT = 0.01
"""Last digit of a reading, in standard uncertainties, below which it would show noise. Origin:
assumed."""

NEARLY_ALL = 0.9
"""Share of stretches in which a hypothesis about a reading must hold. Origin: assumed."""

DISAGREES_SOMEWHERE = 0.1
"""Share of stretches that must disagree with a reading as it stands before it is freed. Origin:
assumed."""

NOISE_ELSEWHERE = 3.0
"""Noise of the same sensor elsewhere, in last digits of a reading, at which no 20 readings in a row
are the same. Origin: assumed."""

FEWEST_MOVING = 2
"""Readings that must move for a recording to have been measured, and not computed. Origin:
assumed."""

FROZEN_ODDS = 10.0
"""Chi-square that a rival fault must leave beyond what the freed reading leaves: both have one free
value at each operating point, so odds are 150 to 1. Origin: assumed."""

FEWEST_FOR_HEADERS = 20
"""Settled samples below which no header is doubted. Origin: assumed."""

AGREES_AS_RECORDED = 0.5
"""Share of stretches in which readings may agree as recorded at most, for a header to be doubted: a
wrong reading agrees where it hardly matters. Origin: assumed."""

AGREES_OTHERWISE = 0.1
"""Share of stretches in which readings must agree when read differently, without any fault. Origin:
assumed."""

NEAREST_RESIDUALS = 12
"""Residuals that are asked first whether a reading may have shown another value; abc has nine in
all. Origin: numerical, more cost more and those of few readings tell most."""

HEADER_ODDS = 6.0
"""Chi-square that a fault must leave beyond what another reading of the columns leaves, to be no
rival: odds of 20 to 1 at one operating point. Origin: assumed."""

CHANGED_ROUGHLY = 0.01
"""Share of chi-square of readings read differently by which it may be off where only what changes
is worked out. Origin: numerical; what is left in is worked out in full."""

SWAP_GAIN = 30.0
"""Chi-square, beside the best single fault, that swapping two columns back must take away at a
typical operating point. Origin: assumed."""

READS_OTHERWISE = 10.0
"""How far readings must be from what is recorded, in standard uncertainties, to be other ones.
Origin: assumed."""

NOISY_READING = 5.0
"""Noise of a reading, read differently, in standard uncertainties of its class at most. Origin:
assumed."""

NOISY_SHARE = 0.05
"""Noise of a reading, read differently, as a share of it at most: nothing that is nearly zero
becomes a reading by a factor. Origin: assumed."""

NEAR_UNITS = 2.0
"""Units that differ by less are no mix-up that readings could tell from a fault. Origin:
assumed."""

# Estimates of a flow and what is usable ----------------------------------------------------------

BEYOND_CALIBRATED = 0.1
"""Share of the calibrated range by which readings may leave it. Origin: assumed."""

HALF_KNOWN = 0.5
"""Share of the samples of a stretch, less one, in which a reading must be there: one that comes
with every second sample is. Origin: assumed."""

LINKED = 1e-9
"""Share of an estimate in another's redundancy above which both belong to one block. Origin:
numerical."""

NULL_SPACE = 1e-10
"""Singular value, over the largest, below which it counts as zero. Origin: numerical."""

PSEUDO_INVERSE = 1e-9
"""Eigenvalue of an information matrix, over the largest, below which it counts as zero. Origin:
numerical."""

DETERMINED = 1e-6
"""Part of a flow that estimates may leave open and still determine it. Origin: numerical."""

RIDGE = 1e-12
"""Ridge of a covariance, relative to its trace, that keeps it regular. Origin: numerical."""

RIDGE_OF_INFORMATION = 1e-14
"""The same of an information matrix. Origin: numerical."""

LEAST_U = 1e-12
"""Standard uncertainty of a degree at least, where it weights a mean. Origin: numerical."""

# Baseline --------------------------------------------------------------------------------------

WORTH_LEARNING = 0.02
"""Information (nat) per residual below which a further stretch is not worth learning. Origin:
assumed."""

LEARNED_AT_ONCE = 256
"""Points at most that are looked at together for what they add to the baseline. Origin:
numerical."""

ROUNDED_OTHERWISE = 1.0 + 1e-9
"""Factor by which what points add, looked at together, may differ from what they add on their own,
which decides. Origin: numerical."""

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

WANDERS = ((LASTING, 0.125), (7.0 * 86400.0, 0.125), (90.0 * 86400.0, 0.25), (math.inf, 0.5))
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
"""Faults whose courses are worked out, besides those that are named: those that explain most to
first order. Origin: assumed."""

PARTS_OF_A_COURSE = 3
"""Degrees of freedom of a course: where it begins, how large it is and how fast it grows. Origin:
distribution."""

GROWS = math.log(20.0)
"""Evidence of growth over steps from which on a fault is told to grow. Origin: assumed, strong
evidence (Kass and Raftery 1995)."""

# Test of a hypothesis ----------------------------------------------------------------------------

UNTOUCHED = 1e-6
"""Share of a fault's own effect below which residuals count as untouched (it cancels). Origin:
numerical."""

TABLE = 1_000_000
"""Numbers in a table that is worked on at once: it stays in the cache, and memory flat. Origin:
numerical."""

MANY_RESIDUALS = 128
"""Residuals of a problem from which on its covariance is inverted once for all hypotheses. Origin:
numerical; below that it costs less to invert one for each of them."""

MOST_WEIGHED = 8_000_000
"""Numbers in the inverse covariances up to which that is so: more take too much memory. Origin:
numerical."""

ROWS_OF_A_FAULT = 16
"""Combinations of estimates at most of the mean of stretches, and of their differences, by which
they tell of one fault in a plant with `MANY_RESIDUALS`. Origin: numerical; a fault of a module
moves up to three estimates, and of those that move hundreds the others add next to nothing."""

ROWS_TOGETHER = 64
"""The same of faults that are compared with each other. Origin: numerical."""

LEADING = 4
"""Faults that leave least at best, which are tried first in such a plant: what they leave says
which of the others need not be tried. Origin: numerical."""

GAIN_AT_FIRST = 0.1
"""Share of what the best of these lowers chi-square by which another one lowers it at least to
first order in its degree, if it moves more than `ROWS_OF_A_FAULT` flows and is to be tried. Origin:
assumed; readings act nearly in proportion to their errors, so the first order is nearly all."""

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
"""Probability, relative to the best, below which a fault is not tried at a point of such a plant.
Origin: numerical; alternatives are mentioned from `MENTION` on."""

IMPROBABLE_THROUGHOUT = 1e-3
"""Probability in every stretch of a run below which a fault is not compared in all of them
together, in such a plant. Origin: numerical; alternatives are mentioned from `MENTION` on."""

SAME_ROWS = 1e-6
"""Relative size below which a combination of estimates says nothing new. Origin: numerical."""

LEFT_OF_ERRORS = 1e-6
"""Share of the variance by errors that last which counts as new at every point in such a plant.
Origin: numerical."""

ESTIMATES_AT_ONCE = 1_000_000
"""Numbers in the covariances of estimates of points that are worked on together, in such a plant.
Origin: numerical, what is found is the same."""

CHANGED_ALONE = 0.25
"""Share of the residuals of a problem up to which a change of so many flows is worked out alone.
Origin: numerical; with more of them a new inverse costs less."""

FEW_COLUMNS = 2048
"""Points of all hypotheses together up to which one plan undoes all of them: a call costs as much
as that. Origin: numerical."""

OPERATIONS_OF_A_CALL = 200
"""Operations of a plan on a few numbers that cost as much as another call of a plan. Origin:
numerical."""

PLANS_KEPT = 512
"""Parts of a plan, as those of hypotheses tried together, that are kept for the next time. Origin:
numerical."""

FIT_STEPS = 15
"""Gauss-Newton steps at most; a step that leads away is halved, and counts. Origin: numerical."""

FIT_CONVERGED = 1e-9
"""Change of a degree below which it stands. Origin: numerical."""

FIT_STARTS = (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.97, 1.5, 2.5, 5.0, 10.0)
"""Degrees tried first: far from its start Gauss-Newton may run into a pole of the law. Origin:
numerical."""

PAIR_STARTS = (0.1, 0.3)
"""Degrees of each of two faults tried first. Origin: numerical."""

BELOW_HIGHEST = 1e-6
"""Share of its highest degree by which a fit stays below it: there a law has its pole. Origin:
numerical."""

SHEET_REACH = 8.0
"""Standard uncertainties that a parameter of a sheet may be off. Origin: distribution (Student with
three degrees of freedom, as sheets are believed; two-sided, 0.4 %)."""

END_OF_RANGE = 1e-3
"""Share of its highest degree within which a fit counts as at the end of its range. Origin:
numerical."""

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

HOLDS_TOGETHER = 0.05
"""A cause more probable than this in every stretch holds a run together. Origin: assumed."""

SAME_DEGREE = 0.1
"""Relative change of a degree, beyond its scatter, that still counts as the same fault. Origin:
assumed."""

LOOK_BACK = 8
"""Stretches of a run that a new one is compared with. Origin: assumed."""

STACKED = 8
"""Stretches that are stacked of a run, and of its baseline, spread over their length. Origin:
assumed."""

PAIR_CANDIDATE = 0.02
"""Probability in some stretch from which on a fault is a candidate for a pair. Origin: assumed."""

TRIED_AT_OTHER_TIMES = 3
"""Faults tried as being there at other times: those that explain most to first order. Origin:
assumed."""

KNOWN_FAULT = math.log(10.0)
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

FREQUENCY_ODDS = {"common": 10.0, "usual": 1.0, "rare": 0.1}
"""Prior odds of a fault by the word for how often it comes, over one that comes as usual. Origin:
assumed; steps of ten, as the words stand for orders of magnitude and for no counts."""

UNLISTED_ODDS = 0.1
"""Prior odds of an error of a reading that no module lists, over a listed fault of the same word.
Origin: assumed; who describes a module lists what comes in it."""

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

HEADLINE_RIVAL = 0.2
"""Alternatives more probable than this stand in the headline. Origin: assumed."""

# Plants that store -------------------------------------------------------------------------------

SAMPLES_FITTED = 4096
"""Samples of a recording at most; neighbours of longer recordings are averaged. Origin: assumed."""

WINDOWS_SIDE_BY_SIDE = 8
"""Windows that a recording is cut into, where that leaves them long enough. Origin: assumed."""

SHORT_WINDOW = 48
"""Samples of a window at least, where a recording has them. Origin: assumed."""

LONG_WINDOW = 256
"""Samples of a window at most. Origin: assumed."""

FEWEST_IN_WINDOW = 24
"""Samples without a pause below which nothing is judged. Origin: assumed."""

PAUSE_STORES = 20.0
"""Sampling intervals without a sample that balances cannot be followed across: what is given may
have been anything. Origin: assumed."""

WINDOW_KNOWN = 0.8
"""Share of the samples of a window in which given readings, and some measured one, must be there.
Origin: assumed."""

USUAL_MISFIT = 0.4
"""Share of windows whose misfit counts as usual: less than half, as a fault may begin in the
middle. Origin: assumed."""

MISFIT_PASSES = 4
"""Times at most that the usual misfit is raised. Origin: numerical."""

MISFIT_TOO_SMALL = 1.1
"""Chi-square over freedom from which on the usual misfit was taken too small. Origin: assumed."""

LARGEST_MISFIT = 5.0
"""Factor by which the misfit of windows that know of each other may exceed that of windows on their
own: beyond it, something is wrong in most of them. Origin: assumed."""

SLOW_ERROR = 1.5
"""Correlation length, in samples, from which on an error counts as slow. Origin: assumed."""

REMARKABLE_MISFIT = 1.5
"""Usual misfit over noise from which on it is worth a remark. Origin: assumed."""

EDGE_PLACES = 32
"""Times that are tried for the beginning or the end of a fault. Origin: assumed."""

HIDDEN_EFFECT = 1e-9
"""Share of a fault's effect that is left beside all errors below which it shows nothing. Origin:
numerical."""

SMALLEST_START = 0.02
"""Smallest degree from which a fit of a fault starts. Origin: numerical."""

LARGEST_START = 0.5
"""Largest degree, as a share of the highest, from which a fit of a fault starts. Origin:
numerical."""

WINDOWS_IN_A_ROW = 3
"""Windows over which a finding must hold: the first and the last of them share no sample. Origin:
assumed."""

FITS_MOST = 0.8
"""Share of windows that a fault must fit in to explain all of them. Origin: assumed."""

SPELL_DECIMALS = 2
"""Decimals of log-likelihoods: faults that a fit tells apart by less are named in their order.
Origin: numerical, windows are fitted no closer."""

LEAST_U_STORES = 1e-9
"""Standard uncertainty of a degree in a window at least, where it weights a mean. Origin:
numerical."""

WINDOW_STEPS = 40
"""Levenberg-Marquardt steps of a fit at most. Origin: numerical."""

WINDOW_SETTLED = 1e-3
"""A fit ends when chi-square falls by less than this. Origin: numerical."""

WINDOW_SLIGHT = 1e-5
"""Or by less than this share: what is far off is not worth the last step. Origin: numerical."""

FIRST_DAMPING = 1e-3
"""Damping of the first step of a fit. Origin: numerical."""

LESS_DAMPING = 0.2
"""Factor on the damping after a step that led on. Origin: numerical."""

MORE_DAMPING = 8.0
"""Factor on the damping after a step that led away. Origin: numerical."""

LARGEST_DAMPING = 1e6
"""Damping beyond which no step leads on. Origin: numerical."""

LARGEST_CHI_SQUARE = 1e15
"""Chi-square beyond which a course says nothing. Origin: numerical."""

LEAST_CURVATURE = 1e-12
"""Share of the largest curvature by which none is smaller: keeps matrices regular. Origin:
numerical."""

SIGNATURE_SAMPLES = 400
"""Samples of the course in which effects of faults are compared. Origin: assumed."""

SIGNATURE_STEP = 2.0
"""Seconds between them. Origin: assumed."""

SIGNATURE_SWING = 0.2
"""Share of its reference by which each given reading swings in that course. Origin: assumed."""

SIGNATURE_PACE = 40.0
"""Seconds per radian of the swing of the first given reading. Origin: assumed."""

SIGNATURE_PACES_APART = 17.0
"""Seconds per radian by which each further one is slower. Origin: assumed."""

# Exit codes --------------------------------------------------------------------------------------

NOT_ALL_SEEN = 3
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

LONGEST_STEP = 0.5
"""No damped step moves an unknown by more than this share of its scale: laws may end nearby.
Origin: numerical."""

STATISTICAL_SHARE = 0.3
"""Standard deviation of the statistical error of a simulated sensor, as a share of the systematic
standard uncertainty. Origin: assumed, the seed paper publishes systematic bounds only."""

# What is kept for the next start ----------------------------------------------------------------

MOST_KEPT_BYTES = 400_000_000
"""Bytes of all compiled plants that are kept; beyond it the oldest go. A plant of abc's size takes
0.1 MB. Origin: assumed."""

# Plan ------------------------------------------------------------------------------------------

PLAN_TILE = 256
"""Samples at a time where machine code of a plan has several loops: what one leaves for the next
stays in the cache. Origin: measured by `python -m pytest tests/bench/test_plan.py -s`."""

PLAN_LOOP = 2048
"""Operations in one loop of such code; LLVM takes longer for each of longer ones.
Origin: measured by `python -m pytest tests/bench/test_plan.py -s`."""

PLAN_CALL = 1200
"""Samples in whose time numpy is called for an operation once.
Origin: measured by `python -m pytest tests/bench/test_plan.py -s`."""

PLAN_CODE_WORTH = 400_000
"""Samples for which a plan has been run before machine code is made of it: half as long again as
making it takes. Origin: measured by `python -m pytest tests/bench/test_plan.py -s`."""

KEPT_CODE_WORTH = 200_000_000
"""Operations times samples that a plan has been run for before code is looked for that an earlier
start kept: half as long again as loading LLVM takes.
Origin: measured by `python -m pytest tests/bench/test_plan.py -s`."""

KEPT_CODE_EFFORT = 1
"""How much LLVM is asked for where code is kept, of 0 to 3: with 0 code is a third slower, with 2
making it takes longer and gives nothing. Origin: assumed, from single runs."""

# Integrator ------------------------------------------------------------------------------------

KERNEL_WORTH = 12_000
"""Steps that a tape is interpreted for before machine code is made of it: about as long as making
it takes. Origin: assumed, of the order of what `python -m pytest tests/bench/test_integrator.py -s`
prints."""
