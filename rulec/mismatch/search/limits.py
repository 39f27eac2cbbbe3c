"""Every number that decides in the search for missing effects, with its origin."""

# Refits.

HALF_STEPS = 50
"""Most steps of a refit that starts close to its optimum. Origin: numerical."""

REFIT_STEPS = 25
"""Most steps of a refit of a set. Origin: numerical."""

# Prices and gains: log likelihood and log odds.

COMMON = 6.0
"""Additional gain required of a claim about several modules instead of one. Origin: assumed."""

# Faults that come and go.

COMING = 4
"""Number of faults that come and go refitted in a round. Origin: assumed."""

LONGEST_COURSE = 1500
"""Means to which a course is reduced before it is cut: the effort grows with their square. Origin:
numerical."""

PERIOD_PENALTY = 3.0
"""Price of a period in half log(points): both ends, and its existence. Origin: source (Schwarz
1978, three values)."""

ODD = (0.0, 0.02, 0.05, 0.1)
"""Shares of the time that extreme levels on either side may take without being a state, tried in
turn: another error may occur at times. Origin: assumed."""

FAINT = 0.01
"""Share of the mean information on a degree below which a point is ignored. Origin: assumed."""

PASSING = 0.9
"""Weight of the gain of a fault that is present when the recording begins. Origin: assumed."""

BEGINS = 200
"""Onsets of a permanent fault to try. Origin: numerical."""

STEP_PENALTY = 4.0
"""Price of a step of a course, in log(means): its time and its level. Origin: assumed."""

TWO_STATES = 0.75
"""Share of the scatter of all levels that two states must explain. Origin: distribution (uniform:
evenly spread levels give as much)."""

AT_ONCE = 0.6
"""Share of the distance between two states that one step must cover: a slow swing is no fault that
comes and goes. Origin: assumed."""

ONE_LEVEL = 0.25
"""Relative difference below which successive levels are one period. Origin: assumed."""

MOST_LEVELS = 3
"""Largest number of degrees of a fault. Origin: assumed."""

LEVELS_LEAVE = 0.05
"""Share of the scatter of degrees that a few levels may leave unexplained. Origin: assumed."""

SHORTEST = 3
"""Shortest period, in means. Origin: assumed."""

# Terms without a name.

LATENT_KNOTS = (2, 4, 7, 12, 20, 40)
"""Numbers of knots of a free course in time; the fewest that suffice are taken. Origin: assumed."""

KNOT_POINTS = 4
"""Fewest points per knot. Origin: assumed."""

KNOT_ODD = 3.0
"""Robust standard deviations at which points of a course are clipped. Origin: assumed."""

BANDS = (8, 6, 4)
"""Numbers of pieces of a curve over one reading at settled points; the most that its readings
resolve are taken. Origin: assumed."""

BAND_WIDTH = 4.0
"""Smallest width of a piece of a curve, in the noise of the reading. Origin: assumed."""

# Effort of the search in plants that store.

WEIGHED = 6
"""Other explanations that are fitted to convergence. Origin: assumed."""

# Evidence and odds.

INEXACT = 0.5
"""Probability that an error of laws or sensors is the cause where an explanation moves no reading
by more than they may be off. Origin: assumed (the recording cannot distinguish the two)."""

SIZES_STEPS = 6
"""Most steps to find the errors of form of single laws. Origin: numerical."""

SIZES_GAIN = 0.05
"""Gain, nats, below which no further such step is taken. Origin: numerical."""

EFFECT_FORM = 0.1
"""Usual error of form of an effect's own law, as a share of its change: straight lines and
exponentials approximate a dependence on temperature over a wide range. Origin: assumed."""

TERM_ODDS = -3.0
"""Log odds of a term without a name against a law: the catalogue has nineteen of twenty effects.
Origin: assumed."""

CURVE_POINTS = 41
"""Points at which a term without a name is reported over its driver. Origin: numerical."""

FEWEST_ON_A_BRANCH = 5
"""Fewest visits on either branch for a comparison. Origin: assumed."""

SCATTERS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Scatter of visits to try, as shares of their total spread. Origin: numerical."""

HARDLY_SHOWN = 0.01
"""Share of the usual weight of a point below which branches ignore it: an error there shows a tenth
as much. Origin: assumed."""

LIKELY_SET = 1e-3
"""Probability below which a set is assumed to show. Origin: numerical."""

MISSING_ODDS = -1.6
"""Log odds of any explanation against none: one in six models that are compared with their plant
lacks something. Origin: assumed."""

SORT_ODDS = {"physics": 0.0, "ageing": -0.5, "fault": -1.0, "sensor": -2.0}
"""Prior log odds of each sort of explanation. Origin: assumed."""

WIDER = 3.0
"""Factor by which an amplitude may be larger beside others than alone, in a gain to first order.
Origin: numerical."""

PAIRED_COLUMNS = 500
"""Columns, those of the largest gain, whose pairs are all scanned. Origin: numerical."""

FIRST_SETS = 40
"""Single explanations refitted at first: far from a model, slopes hardly predict the gain of a
large effect. Origin: numerical."""

WORTH_A_REFIT = -2.0
"""Log odds to first order above which a set is refitted. Origin: numerical."""

STIFF = 0.1
"""Factor on the errors of form in an additional scan. Origin: numerical."""

SETS_GROWN = 2
"""Sets grown in a round. Origin: numerical."""

SEARCH_ROUNDS = 8
"""Rounds in which sets are grown. Origin: numerical."""

SETS_SWITCHED = 3
"""Best sets in which faults that come and go are compared with terms that follow set points.
Origin: numerical."""

TERMS_REFITTED = 3
"""Terms without a name refitted per set that is grown. Origin: numerical."""

ONSET_STEPS = (4, 2, 1)
"""Points by which an onset moves, in turn, while that is likelier. Origin: numerical."""

GROWING_STEPS = (0.5, 0.25)
"""The same for growing faults, which need not begin at a point. Origin: numerical."""

ONSET_POINTS = 9
"""Points in the final search for the onset of a fault. Origin: numerical."""

SETS_STANDING = 6
"""Most candidate sets that an experiment is planned for. Origin: numerical."""

LEAST_GAIN = 0.01
"""Least gain, nats, of a reported explanation: shares need a number above zero, even where a set
without it is as likely. Origin: numerical."""

LIKELIER = 0.5
"""Probability above which a member of the best set is reported. Origin: source (Barbieri and Berger
2004, median probability model)."""

WORTH_A_CUT = 20.0
"""Gain, nats, of a fault that comes and goes above which means are cut at its ends. Origin:
numerical."""

SETS_AGAIN = 16
"""Likeliest sets to refit with the errors found about the best one. Origin: numerical."""

TIED = 1e-6
"""Difference in log odds, nats, that only the order of sums makes. Origin: numerical."""
