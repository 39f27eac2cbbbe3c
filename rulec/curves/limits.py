"""Numbers that decide in fits of curves. Origins as in `rulec/limits.py`."""

MOST_SHEET_POINTS = 2000
"""Points that a sheet may have; what has more is a recording. Origin: assumed, a hundred times a
printed table."""

SMALL_POINT = 0.1
"""Share of the largest value of a column that a deviation is a share of at least, as near no flow
every share is large. Origin: assumed."""

SHEET_SCATTER = 0.002
"""Share by which points of a sheet scatter at least: it prints three digits, or somebody read it
off a picture. Origin: assumed."""

MOST_ACCURACY = 0.99
"""Accuracy that a law states at most, as a share. Origin: source, the schema of module types, which
allows less than 1."""

SHEET_DENSITY = 998.2
"""Density to which heads belong where a sheet names none, kg/m3. Origin: source: water at 20 degC,
IAPWS-95; sheets hold for clean cold water (ISO 9906:2012, 1)."""

FAR_SHARE = 1e6
"""Deviation that a law counts with where it has no value, as a share of a point. Origin: numerical;
squares of it still add up."""

SCALES = (1e-3, 1e-2, 0.1, 0.3, -1.0, 3.0, 10.0, 1e2, 1e3)
"""Factors by which a parameter of the type is tried, to find how large it is in another device.
Origin: assumed."""

SCALE_ROUNDS = 3
"""How often each parameter is tried so. Origin: numerical; a billion times as large is found."""

LEARNT_KNOTS = 8
"""Points of a learnt curve at most. Origin: assumed; a table may have 12."""

LEARNT_FAR = 0.2
"""Share of the flow within which no point is set aside from a learnt curve, as straight lines may
be off between knots. Origin: assumed."""

KNOT_GAP = 0.03
"""Share of the span of what a curve follows by which its points are apart at least. Origin:
assumed."""

GAP = 0.15
"""Share of a sensor's range without data that is told. Origin: assumed."""
