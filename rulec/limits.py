"""Numbers that decide what the compiler and what stands on it find, each with its origin."""

UNSURE = 3
"""Exit code of `mismatch` where something is or may be missing, and the recording does not tell
what. Origin: assumed, as `--fail-on` of `watch` has it."""

# Reading files

MAX_FILE_BYTES = 1_000_000
"""Bytes of a file of knowledge or of a plant; longer ones are refused. Origin: assumed."""

KEPT_DOCUMENTS = 2048
"""Documents, and what was read of them, that one process keeps: six times the library.

Origin: assumed."""

MAX_NESTING = 24
"""Levels of a YAML file; deeper ones are refused before anything is built. Origin: assumed."""

MAX_FILE_NUMBER = 1e60
"""Largest size of a number in a file; its reciprocal is the smallest but 0. Origin: numerical,
products of five such numbers stay within a double."""

MAX_INTEGER_DIGITS = 300
"""Digits of a whole number; longer ones are read as text. Origin: numerical, a double ends at
308."""

MAX_DIAGNOSTICS = 100
"""Mistakes that are shown; the others are counted. Origin: assumed."""

MAX_MESSAGE_LENGTH = 300
"""Characters of a message or a hint; the rest is cut off. Origin: assumed."""

MAX_EXCERPT_BYTES = 4_000_000
"""Bytes of a file that are read again to quote a line. Origin: assumed."""

MAX_UNKNOWN_KEYS = 30
"""Unknown keys of one part that are reported; more are some other file altogether. Origin:
assumed."""

NEAREST_NAME = 0.6
"""Likeness, from 0 to 1, from which on a known name counts as the one that was meant. Origin:
standard (the default of difflib.get_close_matches)."""

# Equations

MAX_EQUATION_LENGTH = 600
"""Characters of an equation. Origin: assumed."""

MOST_CURVE_POINTS = 10
"""Points of a curve that `rulec adopt` writes into an equation. Origin: numerical; more points
would make it longer than `MAX_EQUATION_LENGTH`."""

CURVE_DIGITS = 4
"""Significant digits of such a point. Origin: numerical; far below the uncertainty of a curve."""

CURVE_KEPT = 0.01
"""Share of its range by which it may miss the curve that was found. Origin: assumed."""

MAX_EQUATION_DEPTH = 30
"""Operations inside one another in one equation. Origin: assumed."""

MAX_EXPONENT = 8
"""Exponent of a power, and product of the exponents of powers of powers. Origin: assumed."""

MAX_CONSTANT = 1e30
"""Largest size of a number that a part of an equation may have. Origin: numerical, its square and
its reciprocal stay far within a double."""

MAX_DENOMINATOR = 1000
"""Denominator of an exponent, which is kept as a fraction. Origin: assumed."""

MAX_UNIT_LENGTH = 60
"""Characters of a unit. Origin: assumed."""

MAX_UNIT_POWER = 6
"""Exponent in a unit. Origin: assumed."""

MAX_COUNTED_TERMS = 100_000
"""Counts of terms end here, so that a long chain of doublings stays a small number. Origin:
numerical."""

MAX_WORK = 40_000
"""Work, as `Length.work` counts it, that the equations of one file may be. Five times that of the
longest shipped module type, straight-pipe. Origin: assumed."""

MAX_WRITTEN_DEPTH = 150
"""Operations inside one another, through all definitions. Eight times the 18 of straight-pipe;
Python's own stack carries about three times as many. Origin: assumed."""

MAX_LAW_WORK = 300
"""Work that the law of a fault may be, which is put into all equations. Shipped laws have 27 at
most. Origin: assumed."""

MAX_DEFINITION_CHAIN = 50
"""Definitions that stand on one another; a longer chain is a mistake or an attack. Origin:
assumed."""

MULTIPLIED_POWER = 8
"""Whole exponent up to which a power is calculated as a product. Origin: assumed."""

# Knowledge

ASSUMED_ACCURACY = 0.05
"""Share of what it predicts within which a law keeps that states no accuracy. ISO 9906 grade 2B
lets the head of a pump differ by as much, and textbook laws of friction scatter by about that.
Origin: assumed."""

FLUID_POINTS = 25
"""Temperatures over the valid range at which a property must be positive. Origin: assumed."""

LEAST_SCALE = 1e-12
"""Smallest scale of a column, the reciprocal of the largest that columns.schema.json lets pass.
Origin: assumed."""

FAR_ESTIMATES = 50.0
"""Ratio of two estimates of one flow at the typical readings, beyond which a unit may be wrong.
Shipped types have 1.12 at most; units that are mixed up differ by 60 at least. Origin: assumed."""

FAR_READING = 50.0
"""Ratio of the median of a recorded reading to the typical one, beyond which `rulec check` asks for
its unit. As FAR_ESTIMATES. Origin: assumed."""

MOST_INSTRUMENTS = 2
"""Instruments that are proposed for a module that nothing checks. Origin: assumed."""

ALIKE_ESTIMATES = 5.0
"""Ratio of estimates at the typical readings that counts as agreement. Origin: assumed."""

MISREAD_FACTORS = (1e-3, 1e3, 1e-6, 1e6, 1 / 60, 60.0, 1 / 3600, 3600.0)
"""What a parameter in another unit would be off by: prefixes, minutes and hours. Origin: standard
(SI)."""

ASYMMETRY = 1e-6
"""Difference between mirrored correlations of a covariance in a file, beyond which it is refused.
Origin: assumed, files hold ten digits."""

CORRELATION_RIDGE = 1e-12
"""Added to each variance, as a share of it, before a covariance is factored. Origin: numerical."""

BELIEF_FREEDOM = 3.0
"""Degrees of freedom of what is believed of a parameter: sheets and calibrations are wrong now and
then, and by more than a normal distribution allows. Origin: source (Lange, Little, Taylor 1989, as
is usual)."""

CALIBRATION_FAILS = 0.1
"""Odds that a calibration does not hold, and the sheet counts again: it was made with a law that
left something out, or the module was changed since. Origin: assumed."""

STRAINED = 2.0
"""Standard uncertainties off its sheet from which on a parameter is told. Origin: distribution
(normal, two-sided, 5 %)."""

UNBELIEVABLE = 3.0
"""Standard uncertainties off its sheet beyond which a value is not believed. Origin: distribution
(normal, two-sided, 0.3 %)."""

ABSURD_FAULT = 4.0
"""Geometric standard deviations above the usual degree of a fault from which on nobody would
believe it. Origin: distribution (normal, one-sided, 3e-5)."""

DIGITS = 9
"""Significant digits of figures at the reference point. Origin: numerical, fewer than a solver's
last ones."""

LIQUID_SEEN = 0.05
"""Share of the largest shift of a residual by a change of the liquid from which on another one is
expected to move as well. Origin: assumed; what it moves less follows laws known to a factor."""

EFFECT_TRIES = 20
"""Draws of readings and parameters on which the laws of an effect are tried. Origin: assumed."""

EFFECT_TOLERANCE = 1e-12
"""Deviation from the plain law that counts as rounding, as a share of the largest of the plain laws
that a law takes differences of. Origin: numerical."""

TRIED_READINGS = (-7.0, 12.0)
"""Natural logarithms between which readings are drawn there, SI. Origin: assumed."""

# Algebra

ZERO_PIVOT = 1e-9
"""Entries of eliminated balances below this are rounding; balances have entries of about 1. Origin:
numerical."""

# Reference point

REFERENCE_STEPS = 40
"""Newton steps at most. Origin: assumed."""

REFERENCE_HALVINGS = 8
"""Halvings of a Newton step behind which a flow has no value. Origin: assumed."""

REFERENCE_DAMPING = 0.3
"""Largest Newton step, as a share of each reading's own scale. Origin: assumed."""

REFERENCE_STEP = 1e-9
"""Newton step, as a share of each reading's own scale, below which the point stands. Origin:
numerical."""

FLOW_COST = 1e-14
"""Cost of a flow over that of a reading, each in its own scale: the step must be unique. Origin:
numerical."""

SADDLE_RIDGE = 1e-14
"""Taken off the lower diagonal block of the least-length system, which may be singular. Origin:
numerical."""

SHARED_SHARES = (1.0, 0.3, 0.1, 0.03)
"""Shares of the reference readings that modules have in common, tried one after the other. Origin:
assumed."""

VANISHED_RESIDUAL = 1e-6
"""Share of the largest flow below which a residual counts as zero. Origin: numerical."""

# Signatures, rules and isolability

NEGLIGIBLE_EFFECT = 1e-6
"""Share of the flow below which an effect counts as none: it cancels at a fault-free point. Origin:
numerical."""

IMMOVABLE = 1e-9
"""Share of a flow below which a reading moves nothing any more. Origin: numerical."""

MOST_SUMMED = 24
"""Modules whose flows one residual adds up at most, unless as many meet at one place; beyond it,
what flows in is compared at each junction on the way, by those nearest to it, which tells the same:
far sums follow from near ones. Shipped plants add up five at most. Origin: assumed, so that long
chains compile (`pytest tests/bench/test_compile.py`)."""

MOST_RULES = 24
"""Rules of a fault: of the residuals that it moves, those that show it at the smallest degree.
Shipped plants have 14 at most. Origin: assumed, so that long chains compile
(`pytest tests/bench/test_compile.py`)."""

LONG_SUM = 3
"""Sums of more gradients than this are gathered first; it decides the size of the plan only.
Origin: assumed."""

MANY_CORRELATED = 8
"""Correlated observers beyond which the residual's own gradient is the shorter one. Origin:
assumed."""

LEAST_SPREAD = 1e-9
"""Least standard uncertainty of a residual, as a share of the largest: nothing is known exactly.
Origin: numerical."""

ROUNDED_AWAY = 1e-9
"""Share of a fault's squared distance below which it is rounding, and another fault imitates it.
Origin: numerical."""

SAME_DIRECTION = 1.0 - 1e-9
"""Cosine between signatures from which on two faults coincide. Origin: numerical."""

SEPARATED = 4.0
"""Standard deviations that tell two faults apart: two expanded uncertainties. Origin: standard
(GUM, coverage factor 2 for each of the two)."""

SMALL_DEGREE = 0.2
"""Degree, as a share, at which faults should be told apart; beyond it they count as alike. Origin:
assumed."""

SEEN = 2.0
"""Multiple of the degree that shows a fault at which advice may leave one that is hard to see.
Origin: assumed."""

MOST_SENSORS = 4
"""Sensors that one advice asks for at most. Origin: assumed."""

WIDE_JUNCTION = 30
"""At junctions of more modules than this, pairs of faults of different modules are not listed:
their number grows with the square. Origin: assumed."""

FAR_READERS = 6
"""Of modules further away that read a signal of a module, so many nearest ones are looked at.
Origin: assumed."""

# Effects

SHORT_LAW = 60
"""Characters up to which a plain law with drivers replaced stands inside the new law. Origin:
assumed."""

MAX_STEM = 36
"""Characters of a name that a number may follow; names have 41 at most. Origin: assumed."""

MAX_TYPE_STEM = 56
"""Characters of the name of a module type that a number may follow. Origin: assumed."""

NEAREST_DRIVERS = 6
"""Readings of other modules to try for one driver; the nearest along the pipes come first. Origin:
assumed."""

STEEP = 0.5
"""A place is steep in a reading if it changes by more than this share of the reading's change.
Origin: assumed."""

COMPARED_POINTS = 7
"""Operating points around the reference at which two places are compared. Origin: assumed."""

COMPARED_WIDTH = 0.04
"""How far readings are moved there, as a share of themselves. Origin: assumed."""

PROPORTIONAL = 1.0 - 1e-12
"""Squared cosine from which on two places move all observers in one proportion. Origin:
numerical."""

SPREAD = (0.16, 0.84)
"""Quantiles between which a reading's spread is measured. Origin: distribution (normal, one
standard deviation to each side)."""

ONSET_QUANTILES = (0.08, 0.17, 0.26, 0.35, 0.44, 0.53, 0.62, 0.71, 0.8, 0.89)
"""Shares of the recording at which the search for an onset starts. Origin: assumed."""

ONSET_WIDTH = 0.002
"""Time in which a fault sets in, as a share of half the recording: a step with slopes. Origin:
assumed."""

LATEST_ONSET = 1e9
"""Latest onset that is searched for, s; every recording ends before. Origin: assumed."""

START_DEGREE = 0.1
"""Degree of a fault from which a search starts, or half of the highest if that is less. Origin:
assumed."""

# Calibration

COVERAGE = 2.0
"""Half of a calibrated range, in standard uncertainties of the sensor, at least. Origin: standard
(GUM, coverage factor of 95 %)."""

FAR_POINT = 5.0
"""Robust standard deviations beyond which a point is set aside. Origin: distribution (normal, two-
sided 5.7e-7)."""

LEAST_SCATTER = 1e-6
"""Least robust standard deviation of points, as a share of the spread of the flow. Origin:
numerical."""

ROBUST_ROUNDS = 3
"""Fits with far points set aside anew after each. Origin: assumed."""

ROBUST_WIDTH = 0.05
"""Deviation, as a share of the spread of the flow, beyond which the first fit counts linearly.
Origin: assumed."""

SOLVED = 1e-12
"""Relative change of values and squares at which the least-squares solver stops. Origin:
numerical."""

NO_VALUE = 10.0
"""Error that a law counts with where it has no value, in largest true flows. Origin: assumed."""

SLOPE_STEP = 1e-5
"""Step of central differences, as a share of a parameter. Origin: numerical, near the cube root of
the precision of a double."""

POINTS_PER_PARAMETER = 3
"""Settled points that each fitted parameter needs. Origin: assumed."""

MAX_CONDITION = 1e12
"""Condition number of scaled normal equations beyond which parameters are not determined. Origin:
numerical."""

JOINING_STEPS = 20
"""Steps in which recording and data sheet are joined at most. Origin: assumed."""

MISFIT_SETTLED = 1e-6
"""Relative change of a misfit below which it stands; no result shows that many digits. Origin:
numerical."""

UNTOLD = 0.9
"""Share of the uncertainty by its sheet that a parameter keeps at least of which a recording tells
next to nothing. Origin: assumed."""

FAR_OFF = 5.0
"""Standard uncertainties of value and data sheet together beyond which a value is reported; a wrong
unit or column is off by far more. Origin: distribution (normal, two-sided 5.7e-7)."""

OTHER_SIZE = 10.0
"""Factor beyond which a value is of another size than that of a data sheet that states no
uncertainty: a slipped decimal point. Origin: assumed."""

# Study

LOWEST_INPUT = 0.6
"""Lower end of the range of an input, in its reference, where no calibration has one. Origin:
assumed."""

HIGHEST_INPUT = 1.1
"""Upper end of the same range. Origin: assumed."""

POINT_ROUNDS = 20
"""Times that points without a healthy operation are replaced by others. Origin: assumed."""

# A step that tells faults apart

STEP_SECONDS = 60.0
"""Seconds for which a set point is held, with a reading each, where no file of limits asks for
more. Origin: standard here, the longest stretch that a diagnosis judges as one."""

LEVELS_OF_A_STEP = 5
"""Values of an input that are tried, its ends among them. Origin: assumed; what separates most
lies at an end as a rule."""

STEPS_OF_A_RANGE = 20
"""Parts of a range at least between which values are rounded to what is easily set. Origin:
assumed."""

SMALLEST_CHANGE = 0.05
"""Change of an input, in its range, below which a step is not worth its while. Origin: assumed."""

MOST_INPUTS_OF_A_STEP = 3
"""Inputs changed at once; more are tried one by one as long as they help. Origin: assumed."""

CLEARLY_FARTHER = 1.0
"""Standard deviations that a further change must gain. Origin: assumed, one standard
uncertainty."""

SAME_FLOW = 0.01
"""Change of a flow, in itself, up to which it stays the same: what a controller holds. Origin:
assumed."""

STEP_DEGREES = (0.1, 0.2)
"""Degrees, as shares, at which pairs of faults are compared: half of the degree at which they
should be told apart, and this. Origin: assumed."""

STUDY_SEED = 20_250_713
"""Seed of the operating points: all studies of a plant use the same ones. Origin: assumed."""

RELIABLE = 0.95
"""Share of recordings that makes a fault count as found. Origin: assumed."""

BLIND = 0.05
"""Share of recordings below which a fault counts as not seen. Origin: assumed."""

CONFUSED = 0.02
"""Share of recordings below which a confusion is not mentioned. Origin: assumed."""

MOST_CONFUSIONS = 6
"""Confusions that are mentioned. Origin: assumed."""

CONFIDENCE = 0.95
"""Confidence of upper bounds on rates. Origin: assumed."""

ADOPTED_AGREEMENT = 1e-3
"""Share by which an error of the adopted plant may differ from the one reported: digits in files,
and solvers. Origin: assumed."""

# Simulation

NEWTON_STEPS = 30
"""Newton steps at most; a step that leads away is halved, and counts. Origin: numerical."""

NEWTON_CONVERGED = 1e-7
"""Last step, in units of the unknowns' scales. Origin: numerical; Newton squares it, so the result
is better."""

SHRINKS = 0.5
"""Each step over the one before, at most, where a solution is near. Origin: source, natural
monotonicity test, Deuflhard 2004, Newton Methods for Nonlinear Problems, sec. 3.3."""

FIRST_SHARE = 0.25
"""Share of the way from the reference point that is tried first. Origin: numerical."""

SHORTEST_SHARE = 1.0 / 65536.0
"""Share of the way below which the way counts as ended. Origin: numerical."""

NO_FLOW = 1e-4
"""Share of the reference flow that stands for none. Pressures and torques change by less than this
share between it and zero. Origin: numerical, above `SHORTEST_SHARE`."""

OTHER_ROWS = 24
"""Rows in which another operating point is looked for, spread over the recording. Origin:
assumed."""

OTHER_STARTS = (0.25, 0.5, 2.0, 4.0)
"""Factors on the readings found, from which another operating point is looked for. Origin:
assumed."""

OTHER_POINT = 1e-3
"""Share of a reading by which another operating point differs. Origin: assumed."""

GAP_STEPS = 10_000
"""Steps in a gap of the recording at most; with inputs that stand still all has settled by then.
Origin: assumed."""

SAME_EFFECT = 1e-6
"""Effects are alike if they differ by less than this share when scaled to each other. Origin:
numerical."""

FIRST_SAMPLES = 10
"""First samples of a recording that tell where what is stored starts. Origin: assumed."""

FIRST_ORDER = 2
"""Highest order of the curve that is put through them. Origin: numerical."""

START_STEPS = 20
"""Gauss-Newton steps to the start of what is stored. Origin: numerical."""

# Code for controllers ----------------------------------------------------------------------------

LONGEST_IDENTIFIER = 32
"""Characters of a name in exported code. Origin: assumed; common controllers read so many."""

LONGEST_EXPRESSION = 8
"""Names and numbers in an exported expression; what is longer becomes values of its own. Origin:
assumed."""

LEAST_DIVISOR = 1e-60
"""Absolute value that exported code divides by at least, and takes logarithms of. Origin:
numerical; far below any hydraulic quantity in SI, and its fourth power still divides."""

LARGEST_EXPONENT = 700.0
"""Argument up to which exported code takes an exponential. Origin: numerical; e to the 709 is the
largest number that there is."""

NEAR_LINEAR = 0.05
"""Argument up to which exported code takes the series of tanh. Origin: numerical; its five terms
are exact there to 1e-15, and the formula with exponentials is beyond."""

SAME_CONSTANT = 1e-12
"""Share by which a constant of a plan may differ from a parameter that it is. Origin: numerical; a
value goes to its unit and back."""

# Engines ---------------------------------------------------------------------------------------

WORK_AHEAD = 2
"""Calls that wait for each process, so that none is idle. Origin: assumed."""

WORKER_DEATHS = 3
"""Processes that die at a call before it is given up. Origin: assumed, as dask.distributed
has it."""

SCHEDULER_CONNECT = 20
"""Seconds to wait for a scheduler. Origin: assumed."""

# Column maps -----------------------------------------------------------------------------------

MOST_QUESTIONS = 8
"""Questions that a file can raise; more would be the same one again. Origin: numerical."""

SENTINEL = 2
"""How often a number has to stand far outside a range to be one that means missing. Origin:
assumed."""

# Curves of makers ------------------------------------------------------------------------------

MOST_SHEET_POINTS = 2000
"""Points that a sheet may have; what has more is a recording. Origin: assumed, a hundred times a
printed table."""

SMALL_POINT = 0.1
"""Share of the largest value of a column that a deviation is a share of at least, as near no flow
every share is large. Origin: assumed."""

SHEET_SCATTER = 0.002
"""Share by which points of a sheet scatter at least: it prints three digits, or somebody read it
off a picture. Origin: assumed."""

SHEET_DENSITY = 998.2
"""Density to which heads belong where a sheet names none, kg/m3. Origin: source: water at 20 degC,
IAPWS-95; sheets hold for clean cold water (ISO 9906:2012, 1)."""

FAR_SHARE = 1e6
"""Deviation that a law counts with where it has no value, as a share of a point. Origin: numerical;
squares of it still add up."""

SCALES = (1e-3, 1e-2, 0.1, 0.3, -1.0, 3.0, 10.0, 1e2, 1e3)
"""Factors by which a parameter of the type is tried, to find how large it is in another device.
Origin: assumed."""

SCALE_ROUNDS = 3
"""How often each parameter is tried so. Origin: numerical; a billion times as large is found."""

NEAR_END = 1e-12
"""Share of its stated value from which on a positive parameter counts in logarithms, when a fit by
points alone found none. Origin: numerical."""

LEARNT_KNOTS = 8
"""Points of a learnt curve at most. Origin: assumed; a table may have 12."""

LEARNT_FAR = 0.2
"""Share of the flow within which no point is set aside from a learnt curve, as straight lines may
be off between knots. Origin: assumed."""

LEARNT_STEPS = 30
"""Steps that a fit of a learnt curve takes at most. Origin: numerical."""

KNOT_GAP = 0.03
"""Share of the span of what a curve follows by which its points are apart at least. Origin:
assumed."""

GAP = 0.15
"""Share of a sensor's range without data that is told. Origin: assumed."""
