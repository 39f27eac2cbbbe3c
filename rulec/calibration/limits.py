"""Numbers that decide in calibration. Origins as in `rulec/limits.py`."""

COVERAGE = 2.0
"""Half of a calibrated range, in standard uncertainties of the sensor, at least. Origin: standard
(GUM, coverage factor of 95 %)."""

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

MAX_CONDITION = 1e12
"""Condition number of scaled normal equations beyond which parameters are not determined. Origin:
numerical."""

JOINING_STEPS = 20
"""Steps in which recording and data sheet are joined at most. Origin: assumed."""

MISFIT_SETTLED = 1e-6
"""Relative change of a misfit below which it stands; no result shows that many digits. Origin:
numerical."""

FAR_OFF = 5.0
"""Standard uncertainties of value and data sheet together beyond which a value is reported; a wrong
unit or column is off by far more. Origin: distribution (normal, two-sided 5.7e-7)."""

OTHER_SIZE = 10.0
"""Factor beyond which a value is of another size than that of a data sheet that states no
uncertainty: a slipped decimal point. Origin: assumed."""

NEAR_END = 1e-12
"""Share of its stated value from which on a positive parameter counts in logarithms, when a fit by
points alone found none. Origin: numerical."""
