"""Every number that decides in what readings say for and against a model, with its origin."""

from __future__ import annotations

# Recordings: settled points, samples, blocks.

BLOCK_POINTS = 4
"""Settled points that a block needs at least. Origin: assumed."""

POINT_BUDGET = 15_000
"""Settled points times observers at most; of longer recordings more samples are averaged into
one point. It bounds time and memory. Origin: numerical."""

BRIDGED = 0.8
"""Share of readings that must be there for gaps in a reading that no estimate needs to be
bridged. Origin: assumed."""

STATISTICAL_SHARE = 0.3
"""Noise as a share of the systematic uncertainty where the recording does not show it. Origin:
assumed."""

FLOOR_SHARE = 0.1
"""Noise of a mean is at least this share of what the class of its sensor gives: a reading that
is constant by quantisation is not therefore exact. Origin: assumed."""

# Sensors that fail to read.

SENSOR_FAILS = 0.99
"""Probability of a finding that a sensor fails: nothing else does this. Origin: assumed."""

IMPOSSIBLE_SHARE = 0.5
"""Share of its readings from which on a sensor is reported to show what it cannot. Origin:
assumed."""

IMPOSSIBLE_READINGS = 12
"""Number of readings from which on a sensor is reported to show what it cannot. Origin: assumed."""

DROP_OUT_SHARE = 0.005
"""Share of its readings from which on single odd ones are a fault of the sensor. Origin:
assumed."""

DROP_OUT_READINGS = 20
"""Number of single odd readings from which on they are a fault of the sensor. Origin: assumed."""

# Residuals at settled points.

RARE_PATTERN = 0.01
"""Patterns of usable estimates at fewer points than this share are left out. Origin: assumed."""

LEAST_NOISE = 1e-6
"""Noise of an output as a share of its size at least: nothing is exact. Origin: numerical."""

NO_SLOPE = 1e100
"""A slope beyond this is none. Origin: numerical."""

RECONCILED = 3.0
"""Standard uncertainties up to which errors count as noise, and all readings are reconciled;
beyond them the outputs alone are moved. Origin: assumed."""

MOST_TOWARDS_ZERO = 0.95
"""Share of itself by which a reading may be moved towards zero: it keeps its sign. Origin:
numerical."""

MOST_AWAY_FROM_ZERO = 20.0
"""Times itself by which a reading may be moved away from zero. Origin: numerical."""

SINGULAR = 1e10
"""Condition number from which on a system of equations has no solution. Origin: numerical."""

PREDICTOR_STEPS = 12
"""Newton steps in which a relation is solved for a reading. Origin: numerical."""

# Fits to settled points.

FREEDOM = 4.0
"""Degrees of freedom of the Student distribution of residuals. Origin: source (Lange, Little,
Taylor 1989, as is usual)."""

FIT_STEPS = 100
"""Steps after which a fit ends anyway. Of refits with a law in them a quarter is not at its end
after 20: what a law shares with the values of its module bends the valley that it lies in.
Origin: numerical."""

HELD_STEPS = 4
"""Steps of a refit with one value held near the optimum. Origin: numerical."""

SOFTEST = 1e-9
"""Damping of a fit at least. Origin: numerical."""

HARDEST = 1e9
"""Damping beyond which there is no step down. Origin: numerical."""

EASIER = 9.0
"""By how much damping falls at most after a step that was foreseen. Origin: numerical."""

CONVERGED = 1e-4
"""Gain in log likelihood per step, as a share of the points, below which a fit has ended.
Origin: numerical."""

BATCHES = 40
"""Batches of time by whose means neighbours are found to be alike. Origin: assumed."""

FARTHEST = 15.0
"""Logarithm of the factor by which a positive parameter is moved at most. Origin: numerical."""

DRIFTED = 3.0
"""Factor on the class of a sensor that drifts: it was right at another time, or at another
temperature than the usual one. Origin: assumed."""

MISFIT_FAR = 5.0
"""Robust standard deviations beyond which a point is set aside, as in calibration. Origin:
assumed."""

# Fits to plants that store.

EDGE = 0.02
"""Share of the recording before which, and this much before whose end, nothing begins. Origin:
assumed."""

HELD_EVALUATIONS = 8
"""Evaluations of a fit with one value held, which starts near its end. Origin: numerical."""

RUNAWAY = 1e6
"""Error, in standard deviations, of a model whose states grow beyond all bounds. Origin:
numerical."""

DRIFT_KNOTS = 16
"""Values of a slow error of a given reading over a recording. Origin: assumed."""

NOTABLE_DRIFT = 0.001
"""An error within its class that moves no reading by this share of its scatter does not matter.
Origin: assumed."""

LARGE_DRIFT = 0.05
"""An error within its class may change with time where it moves a reading by this share of its
scatter. Origin: assumed."""

ODD_RESIDUAL = 4.0
"""Scales at which residuals are cut where it is looked how alike neighbours are. Origin:
assumed."""

SPREAD_OUT = 1e6
"""Steps that matter at which the range of a value ends that data leave open. Origin: numerical."""

POLISHES = 2
"""Fits to the end, before each of which it is looked anew what errors of sensors do. Origin:
numerical."""

SUDDEN = 250.0
"""Samples of a recording of which a thousandth, the rise in entries of the catalogue, takes a
quarter of a sample. Origin: numerical."""

# Where something is wrong.

REGION_TELLING = 0.35
"""A region is reported if it holds this much more of the mismatch than of the points. Origin:
assumed."""

REGION_CLEARER = 0.02
"""By so much more a later reading must tell a region, to be taken in the place of an earlier
one. Origin: assumed."""

REGION_ENDS = 40
"""Ends of a region that are tried per reading. Origin: numerical."""

REGION_POINTS = 8
"""Values that a reading needs for a region, and more. Origin: assumed."""

PERIODS_MOST = 8
"""Periods of a mismatch at most: with more it is everywhere. Origin: assumed."""

PERIOD_SAMPLES = 20
"""Samples from which on a mismatch may have periods. Origin: assumed."""

PERIOD_PIECES = 120
"""Pieces of time whose mean mismatch is looked at, at most. Origin: assumed."""

PERIOD_LEVEL = 0.25
"""A piece belongs to a period from this share of the highest level on. Origin: assumed."""

PERIOD_HIGHEST = 0.98
"""Quantile of the levels that counts as the highest. Origin: assumed."""

PERIOD_TIME = 0.5
"""Share of the time that periods take at most. Origin: assumed."""

PERIOD_SHARE = 0.8
"""Share of the mismatch that periods must hold. Origin: assumed."""

SLOW_VALUES = 40
"""Values of a course of an error that changes slowly. Origin: assumed."""

SMOOTH_ENOUGH = 0.5
"""Share of the squared errors that a smooth course must explain to be taken. Origin: assumed."""

COURSE_SIZES = (-3.0, 1.5, 19)
"""Decimal logarithms of the smallest and the largest size of an error that are tried, and how
many, as a share of what would move readings by their scatter. Origin: numerical."""

# What each explanation could explain.

MOST_STARTS = 12
"""Combinations of shapes that are tried of one candidate. Origin: numerical."""

BENT = 5.0
"""Ratio of two starts from which on a law is taken to bend between them. Origin: assumed."""

DRIVER_VARIES = 3.0
"""Times the noise of its settled readings by which a driver must vary. Origin: assumed."""

NEAR_ZERO = 0.05
"""Share of its median reading below which no reference lies whose readings are positive. Origin:
assumed."""

HUBER = 2.5
"""Scales beyond which residuals count less, in the second of two linear problems. Origin:
assumed."""

# Intervals and held-out blocks.

STEADY_PACE = (4, 0.15, 1.0, 1.2)
"""Search for an end of an interval at settled points: steps, distance of the fall at which it
ends, smallest growth of a step, and growth where the likelihood rises. Origin: numerical."""

STORES_PACE = (5, 0.1, 1.1, 3.0)
"""The same for plants that store. Origin: numerical."""

# Displays with coarse steps.

COARSE_LEVELS = 4
"""Levels of a coarse display at least. Origin: assumed."""

COARSE_SHOWN = 8
"""Readings of each level of a coarse display, on average, at least. Origin: assumed."""

COARSE_BEYOND = 5.0
"""Step of a coarse display at least, in standard uncertainties of its class. Origin: assumed."""

COARSE_UNEVEN = 0.1
"""How far a level of a coarse display may be off the raster of the others, in steps. Origin:
assumed."""

NO_VALUE = 1e6
"""Error, in units of its noise, of an estimate that a law cannot give. Origin: numerical."""

ALIKE_SHARE = 0.03
"""Inputs of one operating state agree within this share of their range. Origin: assumed."""

ALIKE_NOISE = 4.0
"""Or within this many times their noise. Origin: assumed."""

HELD = 1.5
"""Scatter of an input while a state lasts, in units of its noise, below which it is held. Origin:
numerical."""

FEWEST_VISITS = 6
"""Differences between visits to states from which the noise of means is told. Origin: assumed."""

FORM_VARIES = 6.0
"""Times its noise by which a reading must vary for errors of form to follow it. Origin: assumed."""

MOST_MEANS = 150
"""Means of states, about, that stand for a recording: as many pieces of evidence as its operating
points are, not as its samples. Origin: assumed."""
