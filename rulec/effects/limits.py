"""Numbers that decide what effects join and how they are written. Origins: `rulec/limits.py`."""

CURVE_POINT = 60
"""Characters of an equation for each point of a curve, beside the name of its driver. Origin:
numerical; two numbers with eight digits and an exponent."""

CURVE_DIGITS = 6
"""Significant digits of such a point. Origin: numerical; far below the uncertainty of a curve."""

CURVE_KEPT = 0.01
"""Share of its range by which it may miss the curve that was found. Origin: assumed."""

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
