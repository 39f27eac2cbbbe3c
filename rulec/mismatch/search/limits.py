"""Every number that decides in the search for what is left out, with its origin."""

from __future__ import annotations

# Fits to settled points.

HALF_STEPS = 50
"""Steps of a refit to half of the blocks, which starts near its end. Origin: numerical."""

# Prices and gains: log likelihood and log odds.

RARITY = {"physics": 0.0, "ageing": 0.5, "fault": 1.0, "sensor": 2.5, "free": 20.0, "hidden": 0.0}
"""How much less expected each sort is, in log odds: laws are simplified more often than sensors
leave their class. A free form is chosen among thousands, and pays for that. Origin: assumed."""

COMMON = 6.0
"""What a claim about several modules must gain more than one about a single module. Origin:
assumed."""

NEEDED_OVER_TIME = 3.0
"""Gain in log likelihood that an explanation of a plant that stores needs beyond the logarithm
of those tried. Origin: assumed."""

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

FOLLOWED = 12
"""Readings and states that a term without physics of a plant that stores may follow. Origin:
assumed."""

# How much of the search of plants that store is tried.

DEEPEST = 3
"""Explanations at most: any course is explained by enough of them. Origin: assumed."""

STEP_SHARES = (1.0, 0.3, 0.1, 0.03)
"""Of a step of the model made linear: strong physics bends so much that the whole one leads far
away, and no share of it too. Origin: numerical."""

WEIGHED = 6
"""Other explanations that are fitted to the end. Origin: assumed."""

# Displays with coarse steps.

STUDENT = 4.0
"""Degrees of freedom of errors of points and of stated calibrations. Origin: source (Lange, Little,
Taylor 1989, as is usual)."""

FORM_KNOWN = 2.0
"""Factor within which the error of form of a law is as large as its accuracy says. Origin:
assumed."""

INEXACT = 0.5
"""Probability that laws or sensors are off in some way of their own where an explanation moves no
reading by more than they may be. Origin: assumed (nothing tells the two apart)."""

SIZES_STEPS = 6
"""Steps by which errors of form of single laws are found, at most. Origin: numerical."""

SIZES_GAIN = 0.05
"""Nats below which a further such step is not taken. Origin: numerical."""

FORM_RANK = 1e-2
"""Share of the largest variance below which a smooth course is left out. Origin: numerical."""

MOVING_RANK = 1e-6
"""The same of errors of sensors in time: these may be a thousand times as large as the noise of a
mean, and what is left out would show. Origin: numerical."""

MOVING_SHARES = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0)
"""How far errors of sensors move within their class while a recording runs, as share of their
standard uncertainty, that are tried. Origin: numerical."""

USUAL_MOVING = 0.2
"""The usual one of these: most of a sensor's class is an error that stays. Origin: assumed."""

MOVING_KNOWN = 3.0
"""Factor to which that is known before. Origin: assumed."""

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

MOVED_SHARE = 0.02
"""Share of a driver's range by which it must move to come from one side. Origin: assumed."""

MOVED_NOISE = 6.0
"""Times its noise by which a driver must move to come from one side. Origin: distribution (normal,
beyond chance for every point of a recording)."""

FEWEST_ON_A_BRANCH = 5
"""Visits from either side from which on branches are compared. Origin: assumed."""

SCATTERS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Scatter of visits that is tried, as share of all that they show. Origin: numerical."""

HARDLY_SHOWN = 0.01
"""Share of the usual weight of a point below which it tells nothing of branches: an error there
shows ten times less. Origin: assumed."""

LIKELY_SET = 1e-3
"""Probability of a set below which it counts as if it showed. Origin: numerical."""

MISSING_ODDS = -1.6
"""Log odds of each explanation, whichever it is, against none: of six plants compared with their
model one lacks something. Origin: assumed."""

SORT_ODDS = {"physics": 0.0, "ageing": -0.5, "fault": -1.0, "sensor": -2.0}
"""Log odds of each sort of explanation before the recording. Origin: assumed."""

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

ONSET_POINTS = 9
"""Points at which the onset of a fault is looked for in the end. Origin: numerical."""

SETS_STANDING = 6
"""Sets of explanations that an experiment is planned for. Origin: numerical."""

LEAST_GAIN = 0.01
"""Gain of an explanation that is reported although a set without it is as likely, nats: shares need
a number above zero. Origin: numerical."""

LIKELIER = 0.5
"""Probability from which on a member of the best set is told. Origin: source (Barbieri and Berger
2004, median probability model)."""

WORTH_A_CUT = 20.0
"""Gain of a fault that comes and goes from which on means are cut at its ends, nats. Origin:
numerical."""

SAME_FLOW = 0.3
"""Share by which a reading may differ from an estimate of the flow of its module and be
one. Origin: assumed."""

NO_WANDER = 1e-3
"""Size of an error that wanders, in noise, that is none. Origin: numerical."""

BRIDGED = 5
"""Samples over which errors of a simulation are taken as known. Origin: assumed."""

RUNAWAY = 1e15
"""Slope of an error in the noise of its reading, by a value in SI, of a simulation that runs away.
Origin: numerical."""

FIRST_INNOVATIONS = 64
"""Samples of a run whose innovations are not those of a filter that has settled. Origin:
numerical."""

SMOOTHNESS = (1.0, 3.0)
"""How smoothly an error of a simulation wanders: twice the order of its Matern covariance.
Origin: numerical."""

SHAPES = 16
"""Combinations of shapes at which a set of explanations may begin. Origin: numerical."""

AT_ONCE_GONE = 0.1
"""Samples that an error lasts which is new in each. Origin: numerical."""

SETS_AGAIN = 16
"""Likeliest sets that are refitted with errors as they are about the best one. Origin: numerical.
"""


FAR_OFF = 0.1
"""Size of new errors of a model that is far off, as share of the scatter of its reading. Origin:
numerical."""

EVALUATIONS = 25
"""Evaluations of a fit from afar at most. Origin: numerical."""

EVALUATIONS_OF_EACH = 5
"""The same from each point where one may begin, of which the best goes on. Origin: numerical."""

SAMPLES_TRIED = 320
"""Samples at most on which ways to begin are tried. Origin: numerical."""

FITS_FROM_AFAR = 2
"""Such fits, each with errors as large as the last left them. Origin: numerical."""


STORES_ENDED = 0.1
"""Gain of a step below which a refit of a plant that stores has ended, nats: its evidence is not
known better. Origin: numerical."""
