"""Numbers that decide what a text may be. Origins as in `rulec/limits.py`."""

# Reading files

MAX_NESTING = 24
"""Levels of a YAML file; deeper ones are refused before anything is built. Origin: assumed."""

MAX_FILE_NUMBER = 1e60
"""Largest size of a number in a file; its reciprocal is the smallest but 0. Origin: numerical,
products of five such numbers stay within a double."""

MAX_INTEGER_DIGITS = 300
"""Digits of a whole number; longer ones are read as text. Origin: numerical, a double ends at
308."""

MAX_DIAGNOSTICS = 100
"""Mistakes that are shown; the others are counted. Origin: assumed."""

MAX_MESSAGE_LENGTH = 300
"""Characters of a message or a hint; the rest is cut off. Origin: assumed."""

MAX_UNKNOWN_KEYS = 30
"""Unknown keys of one part that are reported; more are some other file altogether. Origin:
assumed."""

# Equations

MAX_EQUATION_LENGTH = 600
"""Characters of an equation. Origin: assumed."""

MAX_EQUATION_DEPTH = 30
"""Operations inside one another in one equation. Origin: assumed."""

MAX_EXPONENT = 8
"""Exponent of a power, and product of the exponents of powers of powers. Origin: assumed."""

MAX_CONSTANT = 1e30
"""Largest size of a number that a part of an equation may have. Origin: numerical, its square and
its reciprocal stay far within a double."""

MAX_DENOMINATOR = 1000
"""Denominator of an exponent, which is kept as a fraction. Origin: assumed."""

MAX_UNIT_LENGTH = 60
"""Characters of a unit. Origin: assumed."""

MAX_UNIT_POWER = 6
"""Exponent in a unit. Origin: assumed."""
