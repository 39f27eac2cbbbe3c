"""Numbers that decide what a peer does. None was chosen by errors on unseen rows."""

GP_ROWS = 500
"""Samples of a Gaussian process at most: effort grows with their cube. Origin: numerical."""

NETWORK_ROWS = 2000
"""Samples of a neural network at most. Origin: numerical, seconds a fit."""

MEMBERS = 5
"""Networks of an ensemble. Origin: source, Lakshminarayanan 2017 (deep ensembles)."""

HIDDEN = (32, 32)
"""Neurons of the hidden layers. Origin: assumed."""

PENALTIES = (1e-3, 1e-1, 10.0)
"""Penalties on weights of a network; cross-validation chooses. Origin: assumed."""

LAGS = 8
"""Delays of each input of a plant that stores. Origin: assumed."""

LAG_SHARE = 0.1
"""The longest delay as a share of the training recording. Origin: assumed."""

LIBRARY_ROWS = 600
"""Samples of a sparse regression over the catalogue at most. Origin: numerical."""

THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Coefficients below are dropped, of columns and a residual of size 1; cross-validation chooses.
Origin: assumed, a finer grid over the range of the baselines."""

SHOWN = 1e-6
"""A column that moves a reading by less than this share of its residual is none. Origin:
numerical."""

DEPTH = 3
"""Halvings of the space of inputs: eight regions at most. Origin: assumed."""

FEWEST = 30
"""Samples of a region at least: ten each to fit, to select and to test. Origin: assumed."""

FALSE = 0.05
"""Level of the flags of regions, and share of false discoveries. Origin: source, as described in
public summaries of LISDD; the level itself is the usual one."""

NEAR_BEST = 1.1
"""An error within 10 % of the best counts as good as it. Origin: assumed."""

PATIENCE = 600.0
"""Seconds for a simulation. Origin: assumed."""

FIRES = 3.0
"""Noise of a reading beyond which a residual fires. Origin: distribution (three sigma)."""
