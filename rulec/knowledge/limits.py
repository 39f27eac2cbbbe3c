"""Numbers that decide what knowledge may say. Origins as in `rulec/limits.py`."""

# Equations

MAX_COUNTED_TERMS = 100_000
"""Counts of terms end here, so that a long chain of doublings stays a small number. Origin:
numerical."""

MAX_WORK = 100_000
"""Work, as `Length.work` counts it, that the equations of one file may be. Nearly twice the 57,024
of the longest shipped module type, fitted-line. Origin: assumed."""

MAX_WRITTEN_DEPTH = 150
"""Operations inside one another, through all definitions. Eight times the 18 of straight-pipe;
Python's own stack carries about three times as many. Origin: assumed."""

MAX_LAW_WORK = 300
"""Work that the law of a fault may be, which is put into all equations. Shipped laws have 18 at
most. Origin: assumed."""

MAX_DEFINITION_CHAIN = 50
"""Definitions that stand on one another; a longer chain is a mistake or an attack. Origin:
assumed."""

# Knowledge

FLUID_POINTS = 25
"""Temperatures over the valid range at which a property must be positive. Origin: assumed."""

FAR_ESTIMATES = 50.0
"""Ratio of two estimates of one flow at the typical readings, beyond which a unit may be wrong.
Shipped types have 1.12 at most; units that are mixed up differ by 60 at least. Origin: assumed."""

MOST_INSTRUMENTS = 2
"""Instruments that are proposed for a module that nothing checks. Origin: assumed."""

ALIKE_ESTIMATES = 5.0
"""Ratio of estimates at the typical readings that counts as agreement. Origin: assumed."""

SAME_LAW, SAME_LAW_DRAWS = 1e-9, 5
"""Two estimates that differ by less at so many random points are one law. Origin: numerical."""

MISREAD_FACTORS = (1e-3, 1e3, 1e-6, 1e6, 1 / 60, 60.0, 1 / 3600, 3600.0)
"""What a parameter in another unit would be off by: prefixes, minutes and hours. Origin: standard
(SI)."""

ASYMMETRY = 1e-6
"""Difference between mirrored correlations of a covariance in a file, beyond which it is refused.
Origin: assumed, files hold ten digits."""

CORRELATION_RIDGE = 1e-12
"""Added to each variance, as a share of it, before a covariance is factored. Origin: numerical."""

CALIBRATION_FAILS = 0.1
"""Odds that a calibration does not hold, and the sheet counts again: it was made with a law that
left something out, or the module was changed since. Origin: assumed."""

EFFECT_TRIES = 20
"""Draws of readings and parameters on which the laws of an effect are tried. Origin: assumed."""

EFFECT_TOLERANCE = 1e-12
"""Deviation from the plain law that counts as rounding, as a share of the largest of the plain laws
that a law takes differences of. Origin: numerical."""

TRIED_READINGS = (-7.0, 12.0)
"""Natural logarithms between which readings are drawn there, SI. Origin: assumed."""
