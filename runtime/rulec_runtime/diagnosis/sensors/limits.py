"""Numbers that decide about sensors. Origins as in `rulec_runtime/limits.py`."""

# Sensor health: a reading by itself ------------------------------------------------------------

FAILED_BELOW, FAILED_ABOVE = 0.025, 0.0625
"""Shares of its range by which a reading of 3.6 mA lies below it, and one of 21 mA above it.
Origin: source, NAMUR NE 43."""

# Sensor health: a reading against the others -----------------------------------------------------

AT_ZERO = 0.01
"""Share of its range, or of its reference, within which a reading is at zero. Origin: assumed."""

DIES = 2
"""Times at most that a reading dies: a loose contact, not the cycle of a plant. Origin: assumed."""

FLOWS_BEYOND, FLOWS_PART = 10.0, 0.1
"""Standard uncertainties, and share of its reference, beyond which a flow is there. Origin:
assumed."""

LEVEL_THERE = 0.25
"""Share of its range that a level must stand above its end, by the balances, to be there for sure:
they are nominal, and a start is not known. Origin: assumed."""

FEWEST_STRETCHES = 8
"""Stretches in which readings are compared at least, where tables of hundreds of estimates leave
room for few. Origin: assumed."""

SHOULD_MOVE = 6.0
"""Standard uncertainties by which the value that suits the others must move. Origin: assumed."""

SHOULD_MOVE_STORES = 20.0
"""Standard uncertainties by which balances must move a reading that does not. Origin: assumed."""

SHOULD_MOVE_DIGITS = 3.0
"""Steps of its last digit by which a reading should move at least, to be frozen when it does not.
Origin: assumed."""

FINE_DIGIT = 0.01
"""Last digit of a reading, in standard uncertainties, below which it would show noise. Origin:
assumed."""

DISAGREES_SOMEWHERE = 0.1
"""Share of stretches that must disagree with a reading as it stands before it is freed. Origin:
assumed."""

NOISE_ELSEWHERE = 3.0
"""Noise of the same sensor elsewhere, in last digits of a reading, at which no 20 readings in a row
are the same. Origin: assumed."""

FEWEST_MOVING = 2
"""Readings that must move for a recording to have been measured, and not computed. Origin:
assumed."""

FROZEN_ODDS = 10.0
"""Chi-square that a rival fault must leave beyond what the freed reading leaves: both have one free
value at each operating point, so odds are 150 to 1. Origin: assumed."""

FEWEST_FOR_HEADERS = 20
"""Settled samples below which no header is doubted. Origin: assumed."""

AGREES_AS_RECORDED = 0.5
"""Share of stretches in which readings may agree as recorded at most, for a header to be doubted: a
wrong reading agrees where it hardly matters. Origin: assumed."""

AGREES_OTHERWISE = 0.1
"""Share of stretches in which readings must agree when read differently, without any fault. Origin:
assumed."""

HEADER_ODDS = 6.0
"""Chi-square that a fault must leave beyond what another reading of the columns leaves, to be no
rival: odds of 20 to 1 at one operating point. Origin: assumed."""

SWAP_GAIN = 30.0
"""Chi-square, beside the best single fault, that swapping two columns back must take away at a
typical operating point. Origin: assumed."""

READS_OTHERWISE = 10.0
"""How far readings must be from what is recorded, in standard uncertainties, to be other ones.
Origin: assumed."""

NOISY_READING = 5.0
"""Noise of a reading, read differently, in standard uncertainties of its class at most. Origin:
assumed."""

NOISY_SHARE = 0.05
"""Noise of a reading, read differently, as a share of it at most: nothing that is nearly zero
becomes a reading by a factor. Origin: assumed."""

NEAR_UNITS = 2.0
"""Units that differ by less are no mix-up that readings could tell from a fault. Origin:
assumed."""

# Estimates of a flow and what is usable ----------------------------------------------------------

PSEUDO_INVERSE = 1e-9
"""Eigenvalue of an information matrix, over the largest, below which it counts as zero. Origin:
numerical."""

DETERMINED = 1e-6
"""Part of a flow that estimates may leave open and still determine it. Origin: numerical."""
