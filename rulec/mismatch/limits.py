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

SAMPLE_BUDGET = 4096
"""Samples of a plant that stores at most; neighbours of longer recordings are averaged. It
bounds the time of a simulation. Origin: numerical."""

KEPT = 0.25
"""Share of the open samples that faults must leave, or those in faults are not set aside.
Origin: assumed."""

# Fits to settled points.

# Fits to plants that store.

GENTLE = 0.05
"""Share of a step that matters by which a strength is off its null where models are made linear.
Origin: numerical."""

THOROUGH = 60
"""Evaluations of a fit to the end. Origin: numerical."""

ROUNDS = 2
"""Times that a fit to the end looks at its noise anew. Origin: numerical."""

# Where something is wrong.

SAME_PATTERN = 0.99
"""Cosine of the errors of two places from which on no residual tells them apart. Origin:
assumed."""

COURSE_KNOTS = (48, 192)
"""Values of an error over a recording: one that is smooth, and one that surges. Origin: assumed."""

PLACE_NEARLY = 2.0
"""Log likelihood within which of the best place others are not told from it. Origin: assumed."""

PLACE_ALIKE = 0.02
"""Share of the squared errors within which of the best place others are not told from it.
Origin: assumed."""

PLACE_SHARE = 0.3
"""Share of the squared errors that an error of free course must explain for a place to be
reported. Origin: assumed."""

# What has no name.

FEATURE_VARIES = 5.0
"""Times its noise by which a reading must vary to stand in a term without physics. Origin:
assumed."""

# Intervals and held-out blocks.

DROP = 1.92
"""Fall of the log likelihood at the ends of a 95 % interval. Origin: distribution (chi-square with
one degree, 95 %, half)."""

NORMAL_95 = 1.96
"""Standard uncertainties on either side in a 95 % interval. Origin: distribution (normal, 97.5
%)."""

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

FAR_OFF = 3.0
"""Errors of the repaired model, in noise of the reading, from which on the headline tells them.
Origin: assumed."""

MAJOR = 0.5
"""Share of what could be explained that names must have, beside a driver that nobody recorded.
Origin: assumed."""

SPOILED = 0.05
"""Rise of a reading's held-out error, as a share, from which on a repair had better not be used.
Origin: assumed."""

SAME_ERROR = 1e-6
"""Share by which an error may exceed another and still be the same: digits of files and solvers.
Origin: numerical."""

CURVE_CLEAR = 3.0
"""Standard uncertainties by which a curve must rise or fall, or its branches differ, to be told so:
it is looked at between all of its points. Origin: distribution (normal, 1 of 400, some ten
independent points)."""

CURVE_COUNTS = 0.2
"""Share of the height of a curve below which a rise, a fall or a gap between branches is not told.
Origin: assumed."""

CURVE_FLAT = 0.1
"""Share of a rise at either end of it that counts as flat. Origin: assumed."""

# Experiments.

CORNERED = 4
"""Inputs of which the ends are combined in all ways. Origin: numerical."""

PLACES_DOUBLED = 7
"""Doublings of the number of operating points that are tried. Origin: numerical."""

HELD_SAMPLES = 10
"""Settled samples of a step at least. Origin: assumed."""

SHORTEST_STEP = 60.0
"""How long a step lasts where a recording does not tell, s. Origin: assumed."""

WORTH_A_STEP = 0.002
"""By how much a step must raise the probability of the truth. Origin: numerical."""

WORTH_COST = 0.01
"""By how much the probability of the truth must rise to be worth twice the time, or a loss of
product. Origin: assumed."""

SCATTER_NODES = 5
"""Values of a deviate over which the probability of the truth is averaged. Origin: numerical."""

TELLING_STEPS = 6
"""Most steps that tell explanations apart; all others cover what may be set. Origin: assumed."""

COVERING_HELD = 4
"""How many times as long as the shortest step one that covers is held. Origin: assumed."""

TOLD_APART = 3.0
"""Expected log Bayes factor from which on two explanations are told apart, nats: 20 to 1. Origin:
source (Kass and Raftery 1995, strong evidence)."""

FORETELL_STEPS = 8
"""Steps in which readings are found that obey a model. Origin: numerical."""

FORETELL_STEP = 0.5
"""Largest share by which a reading moves in such a step. Origin: numerical."""

FORETOLD_WELL = 0.01
"""By how much readings that are foretold may miss their model, in units of the noise. Origin:
numerical."""

COVERED = 2.0
"""Standard deviations of what is foretold that must stay within the limits of a reading. Origin:
standard (coverage factor of an expanded uncertainty, JCGM 100:2008)."""

CLAIM_STEP = 0.1
"""Step of a number, in its standard deviations, in which the slope of what an explanation says is
taken. Origin: numerical."""

# Displays with coarse steps.

FORM_U = 0.5
"""Share of the accuracy of a law that is the standard uncertainty of its form: it keeps within the
accuracy in 19 of 20 places. Origin: distribution (normal, two-sided, 5 %)."""

FORM_LENGTH = 0.3
"""Distance of inputs, as share of their range, over which errors of form are alike. Origin:
assumed."""

OWN_ERROR = 0.5
"""Share of the variance of a sensor's class that each of several recordings has as its own: its
zero may have been set in between, its slope and curvature hardly. Origin: assumed."""

LOST_TOLD = 3
"""Effects that lost against a term without a name that are told. Origin: assumed."""

ACCURACY_STEPS = 3
"""Refits in which it shows how exact laws are. Origin: numerical."""
