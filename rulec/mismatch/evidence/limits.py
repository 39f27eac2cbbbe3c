"""Every number that decides in the evidence for and against a model, with its origin."""

# Recordings: settled points, samples, blocks.

BLOCK_POINTS = 4
"""Fewest settled points of a block. Origin: assumed."""

POINT_BUDGET = 15_000
"""Most settled points times observers, to bound time and memory; in longer recordings more samples
are averaged into a point. Origin: numerical."""

BRIDGED = 0.8
"""Share of valid readings above which gaps are bridged in a reading that no estimate needs.
Origin: assumed."""

STATISTICAL_SHARE = 0.3
"""Noise as a share of the systematic uncertainty where the recording does not show it. Origin:
assumed."""

FLOOR_SHARE = 0.1
"""Least noise of a mean, as a share of that by the class of its sensor: a reading that quantisation
makes constant is not exact. Origin: assumed."""

# Sensors that fail.

SENSOR_FAILS = 0.99
"""Probability of a finding that a sensor fails: it has no other cause. Origin: assumed."""

IMPOSSIBLE_SHARE = 0.5
"""Share of impossible readings above which a sensor is reported. Origin: assumed."""

IMPOSSIBLE_READINGS = 12
"""Number of impossible readings above which a sensor is reported. Origin: assumed."""

DROP_OUT_SHARE = 0.005
"""Share of single outliers above which they are a fault of the sensor. Origin: assumed."""

DROP_OUT_READINGS = 20
"""Number of single outliers above which they are a fault of the sensor. Origin: assumed."""

# Residuals at settled points.

RARE_PATTERN = 0.01
"""Share of points below which a pattern of usable estimates is ignored. Origin: assumed."""

LEAST_NOISE = 1e-6
"""Least noise of an output, as a share of its size: nothing is exact. Origin: numerical."""

LEAST_ERROR = 1e-12
"""Least error of a reading, SI, in plants that store: a model may predict one that never moves
without any. Origin: numerical."""

NO_SLOPE = 1e100
"""Slopes beyond this count as none. Origin: numerical."""

NO_VALUE = 1e6
"""Error, in units of its noise, of an estimate that a law cannot give. Origin: numerical."""

RECONCILED = 3.0
"""Standard uncertainties up to which errors are noise, and all readings are reconciled; beyond them
only the outputs are moved. Origin: assumed."""

MOST_TOWARDS_ZERO = 0.95
"""Largest shift of a reading towards zero, as a share of it: it keeps its sign. Origin:
numerical."""

MOST_AWAY_FROM_ZERO = 20.0
"""Largest shift of a reading away from zero, in multiples of it. Origin: numerical."""

SINGULAR = 1e-10
"""Determinant of a scaled system of equations below which it has no solution. Origin: numerical."""

PREDICTOR_STEPS = 12
"""Most Newton steps to solve a relation for a reading. Origin: numerical."""

# Fits to settled points.

FREEDOM = 4.0
"""Degrees of freedom of the Student distribution of residuals. Origin: source (Lange, Little,
Taylor 1989, as is usual)."""

FIT_STEPS = 100
"""Most steps of a fit. A quarter of the refits with a law has not converged after 20: a law that
shares an effect with values of its module makes a curved valley. Origin: numerical."""

HELD_STEPS = 4
"""Steps of a refit with one value held near the optimum. Origin: numerical."""

SOFTEST = 1e-9
"""Least damping of a fit. Origin: numerical."""

HARDEST = 1e9
"""Damping beyond which there is no step down. Origin: numerical."""

EASIER = 9.0
"""Largest reduction of the damping after a step that was predicted well. Origin: numerical."""

CONVERGED = 1e-4
"""Gain in log likelihood per step, as a share of the points, below which a fit has converged.
Origin: numerical."""

BATCHES = 40
"""Batches of time whose means show the correlation of neighbours. Origin: assumed."""

FARTHEST = 15.0
"""Largest change of the logarithm of a positive parameter. Origin: numerical."""

DRIFTED = 3.0
"""Factor on the class of a sensor that drifts: it was right at another time or temperature than the
usual one. Origin: assumed."""

MISFIT_FAR = 5.0
"""Robust standard deviations beyond which a point is ignored, as in calibration. Origin:
assumed."""

# Fits to plants that store.

EDGE = 0.02
"""Share of the recording, at its beginning and at its end, in which nothing begins. Origin:
assumed."""

HELD_EVALUATIONS = 8
"""Evaluations of a fit with one value held, which starts near its optimum. Origin: numerical."""

RUNAWAY = 1e6
"""Error, in standard deviations, of a model whose states diverge. Origin: numerical."""

DRIFT_KNOTS = 16
"""Knots of a slow error of an input over a recording. Origin: assumed."""

NOTABLE_DRIFT = 0.001
"""Largest effect on readings, as a share of their scatter, of an error within the class of a sensor
that is ignored. Origin: assumed."""

LARGE_DRIFT = 0.05
"""The same above which the error may change with time. Origin: assumed."""

ODD_RESIDUAL = 4.0
"""Scales at which residuals are clipped for the correlation of neighbours. Origin: assumed."""

SPREAD_OUT = 1e6
"""Widest range, in typical steps, of a value that the data do not determine. Origin: numerical."""

POLISHES = 2
"""Fits to convergence, before each of which the effects of sensor errors are linearised again.
Origin: numerical."""

SUDDEN = 250.0
"""Length of a recording, in samples, in which the rise of catalogue entries, a thousandth of it,
takes a quarter of a sample. Origin: numerical."""

# Location of a mismatch.

REGION_TELLING = 0.35
"""Excess of a region's share of the mismatch over its share of the points above which it is
reported. Origin: assumed."""

REGION_CLEARER = 0.02
"""Excess of a later reading over an earlier one above which it replaces that. Origin: assumed."""

REGION_ENDS = 40
"""Ends of a region to try per reading. Origin: numerical."""

REGION_POINTS = 8
"""Fewest values of a reading for a region. Origin: assumed."""

PERIODS_MOST = 8
"""Most periods of a mismatch: with more it is everywhere. Origin: assumed."""

PERIOD_SAMPLES = 20
"""Fewest samples of a mismatch with periods. Origin: assumed."""

PERIOD_PIECES = 120
"""Most pieces of time over which a mismatch is averaged. Origin: assumed."""

PERIOD_LEVEL = 0.25
"""Share of the highest level above which a piece belongs to a period. Origin: assumed."""

PERIOD_HIGHEST = 0.98
"""Quantile of the levels that counts as the highest. Origin: assumed."""

PERIOD_TIME = 0.5
"""Largest share of the time in periods. Origin: assumed."""

PERIOD_SHARE = 0.8
"""Least share of the mismatch in periods. Origin: assumed."""

# Gain of each candidate.

MOST_STARTS = 12
"""Most combinations of shapes to try for one candidate. Origin: numerical."""

BENT = 5.0
"""Ratio of two starts above which a law counts as nonlinear. Origin: assumed."""

DRIVER_VARIES = 3.0
"""Least variation of a driver, in the noise of its settled readings. Origin: assumed."""

NEAR_ZERO = 0.05
"""Least reference of a driver with positive readings, as a share of its median. Origin: assumed."""

HUBER = 2.5
"""Scales beyond which residuals count less, in the second of two linear problems. Origin:
assumed."""

# Displays with coarse steps.

COARSE_BEYOND = 5.0
"""Least step of a coarse display, in standard uncertainties of its class. Origin: assumed."""

# Operating states.

ALIKE_SHARE = 0.03
"""Largest difference of inputs of one operating state, as a share of their range. Origin:
assumed."""

ALIKE_NOISE = 4.0
"""The same in units of their noise. Origin: assumed."""

HELD = 1.5
"""Scatter of an input during a state, in units of its noise, up to which it is held. Origin:
numerical."""

FEWEST_VISITS = 6
"""Fewest differences between visits to states to estimate the noise of means. Origin: assumed."""

FORM_VARIES = 6.0
"""Least variation, in units of its noise, of a reading that errors of form follow. Origin:
assumed."""

MOST_MEANS = 150
"""Approximate number of means of states of a recording: the evidence follows from its operating
points, not from its samples. Origin: assumed."""

FIRST_INNOVATIONS = 64
"""Samples of a run before the filter has settled. Origin: numerical."""

# Random columns: errors of form, and of sensors that move.

FORM_RANK = 1e-2
"""Share of the largest variance below which a smooth course is omitted. Origin: numerical."""

MOVING_RANK = 1e-6
"""The same for errors of sensors in time: these may be a thousand times the noise of a mean, so
that an omitted course would show. Origin: numerical."""

FORM_NOT_SEEN = 0.3
"""Standard deviations of the noise below which an error of form is omitted. Origin: numerical."""

MOVING_KNOWN = 3.0
"""Factor to which the movement of sensor errors is known a priori. Origin: assumed."""

# Noise: of settled points, and of simulations, which is correlated in time.

NOISE_SCALES = (0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.2, 3.0)
"""Sizes of the noise to try, relative to the expected one. Origin: numerical."""

NOISE_KNOWN = 1.5
"""Factor to which the size of the noise is known a priori. Origin: assumed."""

NEGLIGIBLE_ERROR = 1e-3
"""Size, in noise, of a correlated error that counts as none. Origin: numerical."""

SMOOTHNESS = (1.0, 3.0)
"""Smoothness of the correlated error of a simulation: twice the order of its Matern covariance.
Origin: numerical."""

AT_ONCE_GONE = 0.1
"""Correlation time, in samples, of an error that is new in each sample. Origin: numerical."""

BRIDGED_SAMPLES = 5
"""Longest gap in samples over which errors of a simulation are interpolated. Origin: assumed."""

OVERFLOWN = 1e15
"""Slope of an error, in the noise of its reading, by a value in SI, at which a simulation runs
away. Origin: numerical."""

# Columns, and where the refits of plants that store begin and end.

GROWING_ONSETS = 7
"""Onsets of a growing fault to try at first: neighbours show almost the same. Origin:
numerical."""

DEEPEST = 3
"""Most explanations: with enough of them any course is explained. Origin: assumed."""

SHAPES = 16
"""Most combinations of shapes and strengths from which the refit of a set may start. Origin:
numerical."""

ERROR_FROM_AFAR = 0.1
"""Initial error of a model that is far off, as a share of the scatter of its reading. Origin:
numerical."""

EVALUATIONS = 25
"""Most evaluations of a fit from afar. Origin: numerical."""

EVALUATIONS_OF_EACH = 5
"""The same for each starting point, of which the best is continued. Origin: numerical."""

FITS_FROM_AFAR = 2
"""Number of such fits, each with the errors that the last one left. Origin: numerical."""

STORES_ENDED = 0.1
"""Gain of a step, nats, below which a refit of a plant that stores ends: its evidence is not known
better. Origin: numerical."""

# Terms without a name.

TERM_FUNCTIONS = 12
"""Most smooth functions of a driver in a term without a name. Origin: numerical."""

TERM_LENGTHS = (0.4, 0.1)
"""Correlation lengths of a term without a name, as shares of the range of its driver or of time:
over the whole range, or in a band of it. Origin: assumed."""

FOLLOWED = 12
"""Most readings and states that a term without a name may follow in a plant that stores. Origin:
assumed."""

HARDLY_MOVES = 1e-3
"""Share of its size by which a driver must move for a curve over it. Origin: numerical."""

SAME_FLOW = 0.3
"""Relative difference up to which a reading counts as the flow of its module. Origin: assumed."""

MOVED_SHARE = 0.02
"""Smallest move of a driver that gives a direction, as a share of its range. Origin: assumed."""

MOVED_NOISE = 6.0
"""The same in units of its noise. Origin: distribution (normal, beyond chance for every point of a
recording)."""

# Curves fitted by simulation.

CURVE_RARITY = 20.0
"""Prior log odds against a curve without a name: it is chosen among thousands. Origin: assumed."""

CURVE_PIECES = 40
"""Pieces of a curve fitted by simulation: as fine as the functions are tabulated. Origin:
numerical."""

CURVE_ROUNDS = 12
"""Most rounds to find the size and smoothness of such a curve and the noise. Origin: numerical."""

REDRAWN = 4
"""Most fits of a curve over a state, each over the range of the last. Origin: numerical."""

AS_WIDE = 0.02
"""Share of a range by which the ends of two equal ranges may differ. Origin: numerical."""

NOISE_FALLS = (1.0, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02)
"""Noise with a curve to try, as shares of that without it. Origin: numerical."""

NOISE_STAYS = 0.03
"""Relative change of the noise below which the rounds end. Origin: numerical."""

CURVE_STEPS = 8
"""Steps of a fit of such a curve. Origin: numerical."""

STEP_SHARES = (1.0, 0.3, 0.1, 0.03)
"""Shares of a step of the linearised model to try: laws may bend so much that the whole step leads
far away. Origin: numerical."""

CURVE_CONVERGED = 0.01
"""Gain in log likelihood per step below which a fit of such a curve ends. Origin: numerical."""
