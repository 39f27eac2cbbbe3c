"""Numbers that decide in studies. Origins as in `rulec/limits.py`."""

LOWEST_INPUT = 0.6
"""Lower end of the range of an input, in its reference, where no calibration has one. Origin:
assumed."""

HIGHEST_INPUT = 1.1
"""Upper end of the same range. Origin: assumed."""

POINT_ROUNDS = 20
"""Times that points without a healthy operation are replaced by others. Origin: assumed."""

STUDY_SEED = 20_250_713
"""Seed of the operating points: all studies of a plant use the same ones. Origin: assumed."""

RELIABLE = 0.95
"""Share of recordings that makes a fault count as found. Origin: assumed."""

BLIND = 0.05
"""Share of recordings below which a fault counts as not seen. Origin: assumed."""

CONFUSED = 0.02
"""Share of recordings below which a confusion is not mentioned. Origin: assumed."""

FEW = 10
"""Recordings below which counts are shown, not percentages, which would mean nothing. Origin:
assumed."""

MOST_CONFUSIONS = 6
"""Confusions that are mentioned. Origin: assumed."""

CONFIDENCE = 0.95
"""Confidence of upper bounds on rates. Origin: assumed."""
