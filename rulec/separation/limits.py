"""Numbers that decide which set points separate faults. Origins as in `rulec/limits.py`."""

STEP_SECONDS = 60.0
"""Seconds for which a set point is held, with a reading each, where no file of limits asks for
more. Origin: standard here, the longest stretch that a diagnosis judges as one."""

LEVELS_OF_A_STEP = 5
"""Values of an input that are tried, its ends among them. Origin: assumed; what separates most
lies at an end as a rule."""

STEPS_OF_A_RANGE = 20
"""Parts of a range at least between which values are rounded to what is easily set. Origin:
assumed."""

SMALLEST_CHANGE = 0.05
"""Change of an input, in its range, below which a step is not worth its while. Origin: assumed."""

MOST_INPUTS_OF_A_STEP = 3
"""Inputs changed at once; more are tried one by one as long as they help. Origin: assumed."""

CLEARLY_FARTHER = 1.0
"""Standard deviations that a further change must gain. Origin: assumed, one standard
uncertainty."""

STEP_DEGREES = (0.1, 0.2)
"""Degrees, as shares, at which pairs of faults are compared: half of the degree at which they
should be told apart, and this. Origin: assumed."""
