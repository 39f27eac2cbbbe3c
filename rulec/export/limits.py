"""Numbers that decide in exported code. Origins as in `rulec/limits.py`."""

LONGEST_IDENTIFIER = 32
"""Characters of a name in exported code. Origin: assumed; common controllers read so many."""

LONGEST_EXPRESSION = 8
"""Names and numbers in an exported expression; what is longer becomes values of its own. Origin:
assumed."""

LEAST_DIVISOR = 1e-60
"""Absolute value that exported code divides by at least, and takes logarithms of. Origin:
numerical; far below any hydraulic quantity in SI, and its fourth power still divides."""

LARGEST_EXPONENT = 700.0
"""Argument up to which exported code takes an exponential. Origin: numerical; e to the 709 is the
largest number that there is."""

NEAR_LINEAR = 0.05
"""Argument up to which exported code takes the series of tanh. Origin: numerical; its five terms
are exact there to 1e-15, and the formula with exponentials is beyond."""

SAME_CONSTANT = 1e-12
"""Share by which a constant of a plan may differ from a parameter that it is. Origin: numerical; a
value goes to its unit and back."""
