"""Every number that decides in the comparison of simulation and recording.

Each states what it means and, last, its origin: a distribution and its quantile, a source, the
command that measured it, numerical (it bounds effort or rounding), or assumed.
"""

from __future__ import annotations

# Recordings: settled points, samples, blocks.

FEWEST_POINTS = 12
"""Settled points below which nothing can be compared. Origin: assumed."""

BLOCKS = 25
"""Blocks of time into which a recording is cut; some are held out. Origin: assumed."""

BLOCK_POINTS = 4
"""Settled points that a block needs at least. Origin: assumed."""

POINT_BUDGET = 15_000
"""Settled points times observers at most; of longer recordings more samples are averaged into
one point. It bounds time and memory. Origin: numerical."""

SAMPLE_BUDGET = 4096
"""Samples of a plant that stores at most; neighbours of longer recordings are averaged. It
bounds the time of a simulation. Origin: numerical."""

BRIDGED = 0.8
"""Share of readings that must be there for gaps in a reading that no estimate needs to be
bridged. Origin: assumed."""

STATISTICAL_SHARE = 0.3
"""Noise as a share of the systematic uncertainty where the recording does not show it. Origin:
assumed."""

FLOOR_SHARE = 0.1
"""Noise of a mean is at least this share of what the class of its sensor gives: a reading that
is constant by quantisation is not therefore exact. Origin: assumed."""

KEPT = 0.25
"""Share of the open samples that faults must leave, or those in faults are not set aside.
Origin: assumed."""


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

HALF_STEPS = 50
"""Steps of a refit to half of the blocks, which starts near its end. Origin: numerical."""

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

RELEASE = 30.0
"""Factor on the stated uncertainty of the parameters of a module whose calibration is let go,
where no data sheet says more. Origin: assumed."""

DRIFTED = 3.0
"""Factor on the class of a sensor that drifts: it was right at another time, or at another
temperature than the usual one. Origin: assumed."""

SHEET_HOLDS = 4.0
"""Standard uncertainties that lie at most between a data sheet that holds and a value; by chance
more do in one of 3000 modules of five values. Origin: distribution (normal, two-sided, 6e-5 per
value)."""

MISFIT_FAR = 5.0
"""Robust standard deviations beyond which a point is set aside, as in calibration. Origin:
assumed."""

FAR_MOVED = 5.0
"""Stated uncertainties by which a parameter may move before it is worth a remark. Origin:
assumed."""


# Fits to plants that store.

WIDEST = 6.0
"""Stated uncertainties by which a parameter may leave its value. Origin: assumed."""

SAME_SIGN = 0.02
"""A parameter keeps its sign, and this share of itself. Origin: assumed."""

AT_END = 0.01
"""Share of its range by which a value may be off an end and still count as there. Origin:
numerical."""

INWARD = 0.1
"""Share of the way back from an end whose cost is looked at: see `PRESSING`. Origin: assumed."""

PRESSING = 0.5
"""Log likelihood that `INWARD` must cost for a value to be pressed to an end of its range.
Origin: assumed."""

GENTLE = 0.05
"""Share of a step that matters by which a strength is off its null where models are made linear.
Origin: numerical."""

EDGE = 0.02
"""Share of the recording before which, and this much before whose end, nothing begins. Origin:
assumed."""

HELD_EVALUATIONS = 8
"""Evaluations of a fit with one value held, which starts near its end. Origin: numerical."""

TRIAL_EVALUATIONS = 8
"""Evaluations of a trial. Origin: numerical."""

THOROUGH = 60
"""Evaluations of a fit to the end. Origin: numerical."""

ROUNDS = 2
"""Times that a fit to the end looks at its noise anew. Origin: numerical."""

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

SAME_PATTERN = 0.99
"""Cosine of the errors of two places from which on no residual tells them apart. Origin:
assumed."""

SLOW_VALUES = 40
"""Values of a course of an error that changes slowly. Origin: assumed."""

COURSE_KNOTS = (48, 192)
"""Values of an error over a recording: one that is smooth, and one that surges. Origin: assumed."""

SMOOTH_ENOUGH = 0.5
"""Share of the squared errors that a smooth course must explain to be taken. Origin: assumed."""

COURSE_SIZES = (-3.0, 1.5, 19)
"""Decimal logarithms of the smallest and the largest size of an error that are tried, and how
many, as a share of what would move readings by their scatter. Origin: numerical."""

PLACE_NEARLY = 2.0
"""Log likelihood within which of the best place others are not told from it. Origin: assumed."""

PLACE_ALIKE = 0.02
"""Share of the squared errors within which of the best place others are not told from it.
Origin: assumed."""

PLACE_SHARE = 0.3
"""Share of the squared errors that an error of free course must explain for a place to be
reported. Origin: assumed."""


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


# Prices and gains: log likelihood and log odds.

RARITY = {"physics": 0.0, "ageing": 0.5, "fault": 1.0, "sensor": 2.5, "free": 20.0, "hidden": 0.0}
"""How much less expected each sort is, in log odds: laws are simplified more often than sensors
leave their class. A free form is chosen among thousands, and pays for that. Origin: assumed."""

COMMON = 6.0
"""What a claim about several modules must gain more than one about a single module. Origin:
assumed."""

SURPASSED = 1.35
"""Times the gain of a name that a free curve must gain to say that the name only imitates it.
Origin: assumed."""

HOPELESS = 0.5
"""Share of the gain that is needed, or to be beaten, which the linearised gain of a trial must
promise: it is estimated to first order, and seldom doubles. Origin: assumed."""

NEEDED_OVER_TIME = 3.0
"""Gain in log likelihood that an explanation of a plant that stores needs beyond the logarithm
of those tried. Origin: assumed."""

# How much of the search at settled points is tried.

PAIR_GAINS_MORE = 1.5
"""Times what its parts gain alone, linearised, that a pair gains which hides itself. Origin:
assumed."""

PAIRS_REFITTED = 6
"""Pairs that hide each other that are refitted: some say nearly the same. Origin: assumed."""

NO_PAIR = 0.9
"""Cosine of two terms from which on they are no pair. Origin: assumed."""


# Faults that come and go.

COMING = 4
"""Faults that come and go that are refitted in a round. Origin: assumed."""

LONGEST_COURSE = 1500
"""Means that a course is reduced to before it is cut: the effort grows with their square.
Origin: numerical."""

PERIOD_PRICE = 3.0
"""Price of a period in half log(points): its ends, and that it is there at all. Origin: source
(Schwarz 1978, three values)."""

ODD = (0.0, 0.02, 0.05, 0.1)
"""Shares of the time that extreme levels on either side may take without being a state, tried in
turn: something else may be wrong at times, which is no degree of this fault. Origin: assumed."""

FAINT = 0.01
"""A point says nothing of a degree if it says less than this share of what others say. Origin:
assumed."""

PASSING = 0.9
"""Weight of the gain of a fault that is there when the recording begins. Origin: assumed."""

BEGINS = 200
"""Times at which a fault that stays may begin that are tried. Origin: numerical."""

STEP_PENALTY = 4.0
"""Price of a step of a course, in log(means): its time and its level. Origin: assumed."""

TWO_STATES = 0.75
"""Share of the scatter of all levels that two states explain, if there are two. Origin:
distribution (uniform, as which an even spread of levels gives as much)."""

AT_ONCE = 0.6
"""Share of the distance between two states that a change from one to the other has at once: what
swings slowly is no fault that comes and goes. Origin: assumed."""

ONE_LEVEL = 0.25
"""Levels that follow each other and differ by less than this share are one period. Origin:
assumed."""

MOST_LEVELS = 3
"""Degrees that a fault comes at. Origin: assumed."""

LEVELS_LEAVE = 0.05
"""Share of the scatter of degrees that a few levels may leave. Origin: assumed."""

SHORTEST = 3
"""Means that a period has at least. Origin: assumed."""

# What has no name.

LATENT_KNOTS = (2, 4, 7, 12, 20, 40)
"""Values of a course that is free in time: as few as tell it. Origin: assumed."""

KNOT_POINTS = 4
"""Points per value of such a course at least. Origin: assumed."""

KNOT_ODD = 3.0
"""Robust standard deviations at which single points of a course are cut: one odd point is no
course. Origin: assumed."""

BANDS = (8, 6, 4)
"""Pieces of a curve over one reading at settled points: as many as its readings tell apart.
Origin: assumed."""

BAND_WIDTH = 4.0
"""Times the noise of a reading that a piece of a curve is wide at least. Origin: assumed."""

FEATURE_VARIES = 5.0
"""Times its noise by which a reading must vary to stand in a term without physics. Origin:
assumed."""

FOLLOWED = 12
"""Readings and states that a term without physics of a plant that stores may follow. Origin:
assumed."""

PIECES = (3, 2, 1)
"""Pieces of a curve over one of them: as many as its values tell apart. Origin: assumed."""

PIECE_WIDTH = 0.05
"""Share of the range of its values by which ends of pieces differ at least. Origin: assumed."""

DRAWN = 4
"""Curves that are fitted to the end. Origin: assumed."""


# How much of the search of plants that store is tried.

DEEPEST = 3
"""Explanations at most: any course is explained by enough of them. Origin: assumed."""

BEAM = 6
"""Models that are carried along. Origin: assumed."""

SHARING = 3
"""Models carried along that share an explanation, at most. Origin: assumed."""

EQUIVALENT = 0.01
"""Models whose errors differ by less than this share of their spread are one. Origin: assumed."""

NARROWED = 3
"""Models of two explanations or more that are carried along. Origin: assumed."""

WHITEST = 2
"""Models that are carried along beside those, as what they leave looks most like noise. Where
the plain model is off for long stretches there is little news by its correlation time: then
models hardly stand apart, and prices decide. Origin: assumed."""

SWAPPED = 2
"""Models of each level in which single explanations are exchanged. Origin: assumed."""

LED = 3
"""The best explanations from whose values the plain model is fitted anew. Origin: assumed."""

LEAST_STEP = 1.0
"""Gain of one more explanation below which no further one is tried. Origin: assumed."""

WHITE = 1.3
"""Correlation time in samples below which errors have no structure to explain. Origin: assumed."""

SCATTERED = 4
"""Random starts of a trial beside those that its candidate names. Origin: assumed."""

DESCENDED = 2
"""The best starts from which a trial is fitted, beside the best one with parameters as stated:
recalibration that makes up for strong physics may lie behind a ridge. Origin: assumed."""

STEP_SHARES = (1.0, 0.3, 0.1, 0.03)
"""Of a step of the model made linear: strong physics bends so much that the whole one leads far
away, and no share of it too. Origin: numerical."""

PROMISING = 10
"""Trials on each model with explanations that are fitted further than a glance; on the plain one
all are, as what is told in the end is mostly told there. Origin: assumed."""

SCATTER = 0.7
"""How far random starts are from the last optimum, in stated uncertainties. Origin: assumed."""

POLISHES = 2
"""Fits to the end, before each of which it is looked anew what errors of sensors do. Origin:
numerical."""

ALIGNED = 12
"""Faults that are tried from the onset of the best of them. Origin: assumed."""

SUDDEN = 250.0
"""Samples of a recording of which a thousandth, the rise in entries of the catalogue, takes a
quarter of a sample. Origin: numerical."""

WEIGHED = 6
"""Other explanations that are fitted to the end. Origin: assumed."""

DISTANT = 8.0
"""Log likelihood that those may be behind; unless they would be told by themselves: a trial of
what begins finds a part of its gain at most. Origin: assumed."""

EXCHANGES = 2
"""Exchanges of explanations at most. Origin: assumed."""

EXCHANGE_WORTH = 0.5
"""Gain in log likelihood that an exchange must bring. Origin: assumed."""


# Intervals and held-out blocks.

DROP = 1.92
"""Fall of the log likelihood at the ends of a 95 % interval, and the gain beyond an end of its
range from which on a value is pressed there. Origin: distribution (chi-square with one degree,
95 %, half)."""

NORMAL_95 = 1.96
"""Standard uncertainties on either side in a 95 % interval. Origin: distribution (normal, 97.5
%)."""

STEADY_PACE = (4, 0.15, 1.0, 1.2)
"""Search for an end of an interval at settled points: steps, distance of the fall at which it
ends, smallest growth of a step, and growth where the likelihood rises. Origin: numerical."""

STORES_PACE = (5, 0.1, 1.1, 3.0)
"""The same for plants that store. Origin: numerical."""

LONGEST_STEP = 3.0
"""Factor by which a step to the end of an interval grows at most. Origin: numerical."""

CONFOUNDED = 0.9
"""Correlation beyond which two values are not told apart. Origin: assumed."""

DRAWS = 1000
"""Draws of the bootstrap over held-out blocks. Origin: numerical."""

CHUNKS = 20
"""Pieces of the held-out points that the bootstrap draws from. Origin: assumed."""

LEFT_OPEN = 0.2
"""Share of what was to be explained (squares beyond noise) that names may leave: with more left
they stand for something else. Where names were right they left 0.05 at most in plants made by
the proof, and 0.13 in real tanks. Origin: measured by `rulec prove`."""

BEYOND_NOISE = 1.15
"""Errors of a model over noise from which on something is left at all. Origin: assumed."""

PROVEN = 1.0
"""Log likelihood that names must gain on held-out blocks, or may lose where no reading of those
is off by more than noise: after a step, say, that they do not have. Origin: assumed."""

HIDES = 0.5
"""Share of its gain beside the others below which an explanation is said to hide alone. Origin:
assumed."""

PREDICTORS_TRIED = 5
"""Readings per finding among which the one that shows it best is chosen. Origin: assumed."""

MOST_PREDICTED = 4
"""Readings whose errors are reported where nothing says which. Origin: assumed."""


# Verdicts.

CERTAIN = 0.9
"""Probability below which the best name is one of several. Origin: assumed."""

MENTIONED = 0.1
"""Probability from which on another explanation is named beside the best one: who acts on the
headline had better know of one chance in ten. Origin: assumed."""

REPORTED = 0.02
"""Probability below which alternatives are left out. Origin: assumed."""

PLAUSIBLE = 0.01
"""Probability below which alternatives are not shown. Origin: assumed."""

MAJOR = 0.5
"""Share of what could be explained that names must have, beside a driver that nobody recorded.
Origin: assumed."""

FAR_OFF = 3.0
"""Errors of the repaired model, in noise of the reading, from which on the headline tells them.
Origin: assumed."""

SPOILED = 0.05
"""Rise of a reading's held-out error, as a share, from which on a repair had better not be used.
Origin: assumed."""

SAME_ERROR = 1e-6
"""Share by which an error may exceed another and still be the same: digits of files and solvers.
Origin: numerical."""

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

FORM_LENGTH = 0.3
"""Distance of inputs, as share of their range, over which errors of form are alike. Origin:
assumed."""

FORM_VARIES = 6.0
"""Times its noise by which a reading must vary for errors of form to follow it. Origin: assumed."""

STUDENT = 4.0
"""Degrees of freedom of errors of points and of stated calibrations. Origin: source (Lange, Little,
Taylor 1989, as is usual)."""

FORM_SHARES = (1e-5, 0.001, 0.002, 0.004, 0.008, 0.015, 0.03)
"""Errors of form that are tried, as share of an output's usual size. Origin: numerical."""

USUAL_FORM = 0.01
"""Usual error of form of a law, as that share: formulas of pumps and lines hold to about 1 %.
Origin: assumed."""

FORM_KNOWN = 3.0
"""Factor to which that is known before. Origin: assumed."""

FORM_LAWS = 2.0
"""Factor to which it is known before how much more or less than the others one law is off. Origin:
assumed."""

FORM_MOST = 0.05
"""Share of an output's usual size by which a law is off at most: one that is off by 2 % seems, from
few operating states, to be off by up to twice that. Where it is more, something is missing. Origin:
assumed."""

SIZES_STEPS = 6
"""Steps by which errors of form of single laws are found, at most. Origin: numerical."""

SIZES_GAIN = 0.05
"""Nats below which a further such step is not taken. Origin: numerical."""

FORM_RANK = 1e-2
"""Share of the largest variance below which a smooth course is left out. Origin: numerical."""

MOVING_RANK = 1e-6
"""The same of errors of sensors in time: these may be a thousand times as large as the noise of a
mean, and what is left out would show. Origin: numerical."""

OWN_ERROR = 0.5
"""Share of the variance of a sensor's class that each of several recordings has as its own: its
zero may have been set in between, its slope and curvature hardly. Origin: assumed."""

MOVING_SHARES = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0)
"""How far errors of sensors move within their class while a recording runs, as share of their
standard uncertainty, that are tried. Origin: numerical."""

USUAL_MOVING = 0.2
"""The usual one of these: most of a sensor's class is an error that stays. Origin: assumed."""

MOVING_KNOWN = 3.0
"""Factor to which that is known before. Origin: assumed."""

LARGE_FORM = 0.02
"""An error of form that is large already: what does not show then is not carried along. Origin:
assumed."""

FORM_NOT_SEEN = 0.3
"""Standard deviations of the noise below which an error of form is not carried along. Origin:
numerical."""

NOISE_SCALES = (0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.2, 3.0)
"""Sizes of the noise that are tried, in units of what was expected. Origin: numerical."""

NOISE_KNOWN = 1.5
"""Factor to which the size of the noise is known before. Origin: assumed."""

EFFECT_FORM = 0.1
"""Usual error of form of an effect's own law, as share of what it changes: straight lines and
exponentials stand for what follows a temperature over a wide range. Origin: assumed."""

TERM_SIZES = (1.0, 3.0, 10.0, 30.0, 95.0, 300.0, 950.0, 3000.0)
"""Sizes of terms without a name that are tried, in units of the noise of a point. Origin:
numerical."""

TERM_FUNCTIONS = 12
"""Smooth functions of a driver that a term without a name may hold. Origin: numerical."""

TERM_LENGTHS = (0.4, 0.1)
"""Distances, as share of the range of a driver or of time, over which a term without a name is
alike: all over the range, or in a band of it. Origin: assumed."""

TERM_ODDS = -3.0
"""Log odds of a term without a name against a law: of twenty effects the catalogue has nineteen.
Origin: assumed."""

CURVE_PIECES = 40
"""Pieces of a curve that is fitted by simulation: as fine as the functions are kept.
Origin: numerical."""

CURVE_ROUNDS = 12
"""Times at most that the size of such a curve, its smoothness and the noise are found anew. Origin:
numerical."""

REDRAWN = 4
"""Times that a curve over a state is drawn, each over the range of the last. Origin: numerical."""

AS_WIDE = 0.02
"""Share of a range by which its ends may differ and still be the same. Origin: numerical."""

NOISE_FALLS = (1.0, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02)
"""What noise may fall to with a curve, as share of that without it. Origin: numerical."""

NOISE_STAYS = 0.03
"""Share by which the noise changes at most where that has ended. Origin: numerical."""

CURVE_STEPS = 8
"""Steps of a fit of such a curve. Origin: numerical."""

CURVE_CONVERGED = 0.01
"""Gain in log likelihood per step below which a fit of such a curve has ended. Origin:
numerical."""

HARDLY_MOVES = 1e-3
"""Share of its size by which a driver must move for a curve over it. Origin: numerical."""

CURVE_POINTS = 41
"""Points at which a term without a name is told over its driver. Origin: numerical."""

CURVE_CLEAR = 3.0
"""Standard uncertainties by which a curve must rise or fall to be told so: it is looked at between
all of its points. Origin: distribution (normal, 1 of 400, some ten independent points)."""

CURVE_STEP = 0.15
"""Share of the height of a curve below which a rise or fall is not told. Origin: assumed."""

CURVE_FLAT = 0.1
"""Share of a rise at either end of it that counts as flat. Origin: assumed."""

CURVE_WHOLE = 0.7
"""Share of a driver's range from which on a rise is told as steady. Origin: assumed."""

MOVED_SHARE = 0.02
"""Share of a driver's range by which it must move to come from one side. Origin: assumed."""

MOVED_NOISE = 6.0
"""Times its noise by which a driver must move to come from one side. Origin: distribution (normal,
beyond chance for every point of a recording)."""

FEWEST_ON_A_BRANCH = 5
"""Visits from either side from which on branches are compared. Origin: assumed."""

SCATTERS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Scatter of visits that is tried, as share of all that they show. Origin: numerical."""

BRANCHES_CLEAR = 3.0
"""Standard uncertainties by which branches must differ to be told apart. Origin: distribution
(normal, 1 of 400)."""

HARDLY_SHOWN = 0.01
"""Share of the usual weight of a point below which it tells nothing of branches: an error there
shows ten times less. Origin: assumed."""

BRANCHES_COUNT = 0.2
"""Share of the height of a curve that a gap between branches must have to count; a gap that is
smaller for sure is none. Origin: assumed."""

LOST_TOLD = 3
"""Effects that lost against a term without a name that are told. Origin: assumed."""

SORT_ODDS = {"physics": 0.0, "ageing": -0.5, "fault": -1.0, "sensor": -2.0}
"""Log odds of each sort of explanation before the recording. Origin: assumed."""

LET_GO_ODDS = -2.0
"""Log odds of a calibration that no longer holds. Origin: assumed."""

ONSETS = 23
"""Times at which a fault may begin that are tried at first. Origin: numerical."""

GROWING_ONSETS = 7
"""Times from which a fault may grow that are tried at first: neighbours show nearly alike. Origin:
numerical."""

WIDER = 3.0
"""Factor by which an amplitude may be larger beside others than alone, when what it would gain is
told to first order. Origin: numerical."""

PAIRED_COLUMNS = 500
"""Columns of which all pairs are scanned: those that gain most alone. Origin: numerical."""

FIRST_SETS = 40
"""Single explanations that are refitted at first: far from a model a slope says little of what a
large effect would gain. Origin: numerical."""

WORTH_A_REFIT = -2.0
"""Log odds to first order from which on a set is refitted. Origin: numerical."""

STIFF = 0.1
"""Share of the errors of form with which explanations are scanned too. Origin: numerical."""

SETS_GROWN = 2
"""Sets that are grown in a round. Origin: numerical."""

SEARCH_ROUNDS = 8
"""Rounds in which sets are grown. Origin: numerical."""

LARGEST_SET = 5
"""Most explanations that are named together. Origin: assumed."""

SETS_REFITTED = 12
"""Sets that are refitted of each that is grown. Origin: numerical."""

SETS_SWITCHED = 3
"""Best sets in which faults that come and go are compared with what follows the set points. Origin:
numerical."""

TERMS_REFITTED = 3
"""Terms without a name that are refitted of each set that is grown. Origin: numerical."""

ONSET_STEPS = (4, 2, 1)
"""Points by which an onset is moved, in turn, as long as that is likelier. Origin: numerical."""

GROWING_STEPS = (0.5, 0.25)
"""The same, of what grows: it bends at its onset and need not begin at a point. Origin: numerical.
"""

ONSET_RIVALS = 5
"""Sets with another fault in the place of one of the best set whose onsets are moved as well.
Origin: numerical."""

ONSET_POINTS = 9
"""Points at which the onset of a fault is looked for in the end. Origin: numerical."""

RESAMPLES = 60
"""Draws of weights of a recording's parts, over which probabilities of sets are means. Origin:
numerical."""

RESAMPLED_STRETCHES = 8
"""Stretches of time that are weighted. Origin: numerical."""

RESAMPLED_NATS = 40.0
"""Sets further behind the likeliest one lead in no draw, nats. Origin: numerical."""

RESAMPLED_SETS = 60
"""Sets that are weighed in each draw. Origin: numerical."""

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

DRAWN = 2000
"""Draws of what is read, for the certainty that an experiment can be expected to give: to a percent
or two. Origin: numerical."""

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

SETS_STANDING = 6
"""Sets of explanations that an experiment is planned for. Origin: numerical."""

LEAST_GAIN = 0.01
"""Gain of what is told although a set without it is as likely, nats: shares need a number above
nothing. Origin: numerical."""

LIKELIER = 0.5
"""Probability from which on a member of the best set is told. Origin: source (Barbieri and Berger
2004, median probability model)."""

STRONG = 2.0
"""Standard uncertainties by which a strength that is told differs from none. Origin: distribution
(normal, two-sided, 5 %)."""

WORTH_A_CUT = 20.0
"""Gain of a fault that comes and goes from which on means are cut at its ends, nats. Origin:
numerical."""

MOST_MEANS = 150
"""Means of states, about, that stand for a recording: as many pieces of evidence as its operating
points are, not as its samples. Origin: assumed."""

SAME_FLOW = 0.3
"""Share by which a reading may differ from an estimate of the flow of its module and be
one. Origin: assumed."""


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
