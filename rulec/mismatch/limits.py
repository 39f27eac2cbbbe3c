"""Every number that decides in the comparison of simulation and recording.

Each states what it means and, last, its origin: a distribution and its quantile, a source, the
command that measured it, numerical (it bounds effort or rounding), or assumed.
"""

# Recordings: settled points, samples, blocks.

FEWEST_POINTS = 12
"""Settled points below which nothing can be compared. Origin: assumed."""

BLOCKS = 25
"""Blocks of time into which a recording is cut; some are held out. Origin: assumed."""

SAMPLE_BUDGET = 4096
"""Most samples of a plant that stores; neighbours in longer recordings are averaged. It bounds the
time of a simulation. Origin: numerical."""

KEPT = 0.25
"""Share of the open samples that must be free of faults, or faulty samples are not left out.
Origin: assumed."""

# Fits to plants that store.

GENTLE = 0.05
"""Distance of a strength from its null where models are linearised, as a share of a significant
step. Origin: numerical."""

THOROUGH = 60
"""Most evaluations of a complete fit. Origin: numerical."""

ROUNDS = 2
"""Times that a complete fit estimates its noise anew. Origin: numerical."""

# Places of the mismatch.

SAME_PATTERN = 0.99
"""Cosine of the errors of two places above which no residual distinguishes them. Origin:
assumed."""

# Terms without a name.

FEATURE_VARIES = 5.0
"""Multiple of its noise by which a reading must vary to be used in a term without physics. Origin:
assumed."""

# Intervals and held-out blocks.

DROP = 1.92
"""Fall of the log likelihood at the ends of a 95 % interval. Origin: distribution (chi-square with
one degree, 95 %, half)."""

NORMAL_95 = 1.96
"""Standard uncertainties on either side in a 95 % interval. Origin: distribution (normal, 97.5
%)."""

BEYOND_NOISE = 1.15
"""Ratio of a model's errors to noise above which anything remains at all. Origin: assumed."""

PROVEN = 1.0
"""Log likelihood that named explanations must gain on held-out blocks, or may lose if no reading
there is off by more than noise, as when a step lies outside these blocks. Origin: assumed."""

PREDICTORS_TRIED = 5
"""Readings per finding from which the one that shows it best is chosen. Origin: assumed."""

MOST_PREDICTED = 4
"""Most readings whose errors are reported where no finding selects them. Origin: assumed."""

# Verdicts.

CERTAIN = 0.9
"""Probability below which the best explanation counts as one of several. Origin: assumed."""

MENTIONED = 0.1
"""Probability above which another explanation is named beside the best one: whoever acts on the
headline should know of one chance in ten. Origin: assumed."""

REPORTED = 0.02
"""Probability below which alternatives are left out. Origin: assumed."""

PLAUSIBLE = 0.01
"""Probability below which alternatives are not shown. Origin: assumed."""

FAR_OFF = 3.0
"""Errors of the repaired model, in noise of the reading, above which the headline states them.
Origin: assumed."""

MAJOR = 0.5
"""Share of the explainable mismatch that named explanations need beside an unrecorded driver.
Origin: assumed."""

SPOILED = 0.05
"""Rise of a reading's held-out error, as a share, above which a repair should not be used.
Origin: assumed."""

SAME_ERROR = 1e-6
"""Share by which an error may exceed another and still count as the same: digits of files and
solvers. Origin: numerical."""

CURVE_CLEAR = 3.0
"""Standard uncertainties by which a curve must rise or fall, or its branches differ, to count as
doing so: all pairs of its points are compared. Origin: distribution (normal, 1 of 400, some ten
independent points)."""

CURVE_COUNTS = 0.2
"""Share of the height of a curve below which a rise, a fall or a gap between branches does not
count. Origin: assumed."""

CURVE_FLAT = 0.1
"""Share of a rise at either of its ends that counts as flat. Origin: assumed."""

# Experiments.

CORNERED = 4
"""Most inputs whose ends are combined in all ways. Origin: numerical."""

PLACES_DOUBLED = 7
"""Doublings of the number of operating points that are tried. Origin: numerical."""

HELD_SAMPLES = 10
"""Fewest settled samples of a step. Origin: assumed."""

SHORTEST_STEP = 60.0
"""Duration of a step if the recording does not show it, s. Origin: assumed."""

WORTH_A_STEP = 0.002
"""Least rise of the probability of the truth by a step. Origin: numerical."""

WORTH_COST = 0.01
"""Rise of the probability of the truth that is worth twice the time, or a loss of product. Origin:
assumed."""

SCATTER_NODES = 5
"""Values of a deviate over which the probability of the truth is averaged. Origin: numerical."""

TELLING_STEPS = 6
"""Most steps that discriminate between explanations; others cover the range. Origin: assumed."""

COVERING_HELD = 4
"""Duration of a step that covers the range, in shortest steps. Origin: assumed."""

TOLD_APART = 3.0
"""Expected log Bayes factor above which two explanations count as distinguished, nats: 20 to 1.
Origin: source (Kass and Raftery 1995, strong evidence)."""

FORETELL_STEPS = 8
"""Iterations to find readings that obey a model. Origin: numerical."""

FORETELL_STEP = 0.5
"""Largest change of a reading in such an iteration, as a share. Origin: numerical."""

FORETOLD_WELL = 0.01
"""Largest deviation of predicted readings from their model, in units of the noise. Origin:
numerical."""

COVERED = 2.0
"""Standard deviations of a prediction that must stay within the limits of a reading. Origin:
standard (coverage factor of an expanded uncertainty, JCGM 100:2008)."""

CLAIM_STEP = 0.1
"""Step of a number, in its standard deviations, for slopes of an explanation's predictions. Origin:
numerical."""

# Accuracy of laws and sensors.

FORM_U = 0.5
"""Standard uncertainty of a law's form as a share of its accuracy, which holds in 19 of 20 places.
Origin: distribution (normal, two-sided, 5 %)."""

FORM_LENGTH = 0.3
"""Correlation length of errors of form, as a share of the range of inputs. Origin: assumed."""

OWN_ERROR = 0.5
"""Share of the variance of a sensor's class that is new in each of several recordings: the zero may
have been reset between them, slope and curvature hardly. Origin: assumed."""

LOST_TOLD = 3
"""Most effects reported that lost against a term without a name. Origin: assumed."""

ACCURACY_STEPS = 3
"""Refits that estimate the accuracy of laws. Origin: numerical."""

# The evidence and its search.

FORM_KNOWN = 2.0
"""Factor within which the accuracy of a law gives the size of its error of form. Origin:
assumed."""

MOVING_SHARES = (0.05, 0.1, 0.2, 0.35, 0.6, 1.0)
"""Movements of sensor errors within their class during a recording to try, as shares of the
standard uncertainty. Origin: numerical."""

USUAL_MOVING = 0.2
"""The usual one of these: most of a sensor's class is a constant error. Origin: assumed."""

TERM_SIZES = (1.0, 3.0, 10.0, 30.0, 95.0, 300.0, 950.0, 3000.0)
"""Sizes of terms without a name to try, in units of the noise of a point. Origin: numerical."""

ONSETS = 23
"""Onsets of a fault to try at first. Origin: numerical."""

LARGEST_SET = 5
"""Most explanations reported together. Origin: assumed."""

SETS_REFITTED = 12
"""Sets refitted per set that is grown. Origin: numerical."""
