"""Numbers that decide what a peer does. None was chosen by errors on unseen rows."""

# Samples of a Gaussian process at most: effort grows with their cube. Origin: numerical.
GP_ROWS = 500
NETWORK_ROWS = 2000  # Samples of a neural network at most. Origin: numerical, seconds a fit
MEMBERS = 5  # Networks of an ensemble. Origin: source, Lakshminarayanan 2017 (deep ensembles)
HIDDEN = (32, 32)  # Neurons of the hidden layers. Origin: assumed
# Penalties on weights of a network; cross-validation chooses. Origin: assumed.
PENALTIES = (1e-3, 1e-1, 10.0)
LAGS = 8  # Delays of each input of a plant that stores. Origin: assumed
LAG_SHARE = 0.1  # The longest delay as a share of the training recording. Origin: assumed
LIBRARY_ROWS = 600  # Samples of a sparse regression over the catalogue at most. Origin: numerical
# Coefficients below are dropped, of columns and a residual of size 1; cross-validation chooses.
# Origin: assumed, a finer grid over the range of the baselines.
THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4)
# A column that moves a reading by less than this share of its residual is none. Origin: numerical.
SHOWN = 1e-6
DEPTH = 3  # Halvings of the space of inputs: eight regions at most. Origin: assumed
FEWEST = 30  # Samples of a region at least: ten each to fit, to select and to test. Origin: assumed
# Level of the flags of regions, and share of false discoveries. Origin: source, as described in
# public summaries of LISDD; the level itself is the usual one.
FALSE = 0.05
NEAR_BEST = 1.1  # An error within 10 % of the best counts as good as it. Origin: assumed
PATIENCE = 600.0  # Seconds for a simulation. Origin: assumed
FIRES = 3.0  # Noise of a reading beyond which a residual fires. Origin: distribution (three sigma)
# Blocks in time into which the training samples are cut for cross-validation. Origin: assumed.
CHUNKS = 12
FOLDS = 3  # Folds of the cross-validation; each is every third block. Origin: assumed
SPARSE_DEGREE = 2  # Degree of the polynomials of PySINDy. Origin: assumed
SPARSE_RIDGE = 0.05  # Ridge penalty of its regression. Origin: source, default of PySINDy
SPARSE_ROUNDS = 10  # Most rounds of thresholding in a regression. Origin: assumed
# Thresholds below which coefficients are dropped, for standardised columns and a residual of size
# 1. Cross-validation chooses one. Origin: assumed.
SPARSE_THRESHOLDS = (0.02, 0.1, 0.4)
# Most columns of a law: those that correlate best with the residual. Origin: assumed.
MOST_COLUMNS = 12
FEWEST_SAMPLES = 30  # Least samples from which PySINDy learns. Origin: assumed
