"""Numbers that decide when a plant is watched.

Each states what it means and where it comes from.
"""

KEPT_ROWS = 1024
"""Rows kept at least, readings and all: sensors, noise and settled stretches are judged by them;
twice as many are there before the older half becomes operating points. Origin: assumed; seventeen
stretches of full length, more than a fault takes to be told."""

MOST_ROWS = 3 * KEPT_ROWS
"""Rows in memory with which a look that goes on beside them is waited for. Origin: assumed; at ten
rows a second that is 100 s after memory was full, so that rows hardly ever wait."""

SMALL_PLANT = 60
"""Signals of a plant up to which all that is remembered is judged with each row, as long as it is
little: see `SEEN_AT_ONCE`. Origin: assumed; that takes less than the
tenth of a second until the next row."""

SEEN_AT_ONCE = 16_384
"""Numbers in memory up to which all of it is judged with each row. Origin: assumed; that takes less
than the tenth of a second until the next row."""

LOOKED_AGAIN = 3
"""Times as many rows with which everything is judged again at first: noise is known better then.
Origin: assumed."""

FOLLOWED_AGAIN = 1.02
"""Times as many operating points with which courses of degrees are worked out again. Origin:
assumed; a course that has lasted for a day is followed every half an hour.
"""

DUE_AT_ONCE = 3
"""Parts that get a partial update with one row while nothing of them has moved, where looks go on
beside the rows. Origin: assumed; that takes less than half of a tenth of a second.
"""

PATIENCE = 30
"""Rows that a look beside them may take before a large part that moves gets a partial update, for
which rows wait. Origin: assumed; several times what a look takes that doubts no header.
"""

ROWS_AT_A_GLANCE = 60
"""Rows that come together from which on everything is judged. Origin: assumed; a stretch of full
length."""

MOVED = 5.0
"""Standard deviations of its noise by which a reading, or its mean, is off where it has moved.
Origin: distribution; with 200 signals a row in 3000 seems to move by chance, and is only judged.
Where looks go on beside the rows, it is the same chance of Student's distribution, as a few rows
hardly tell the noise."""

STANDS_STILL = 50.0
"""Equal readings in a row with which a sensor is looked at. Origin: assumed; `STILL_RUN` times
`STILL_TIMES` of the runtime, from which on it may be stuck."""

MOST_POINTS = 256
"""Operating points remembered of what came before. Origin: assumed; more than four hours at a row
a second, beside `LASTING` of the runtime, over which errors of sensors stay what they were."""

BLIND_ROWS = 60
"""Rows in which nothing can be judged before that is told. Origin: assumed; a stretch of full
length, so that a plant that moves from one operating point to the next is no event."""

GROWN = 1.0
"""By how many half widths of its bounds a degree moves before that is told again. Origin:
distribution; within its bounds it has not changed."""

WAIT = 0.2
"""Seconds to wait for rows before looking whether anything else is to be done. Origin: assumed;
shorter than a person notices."""

SET_BACK = 60.0
"""Seconds from which on a date that goes back is that of a clock which was set. Origin: assumed; as
`CLOCK_APART` of the sources, and less is caught up soon."""

STOOD_STILL = 5.0
"""Seconds without a move from which on a process was frozen, suspended, or had its clock set.
Origin: assumed; what moves does so at least once a second."""

FAILED = 3
"""Exit code where something is active that was asked for with `--fail-on`. Origin: assumed; 1 and 2
are mistakes."""

LARGEST_STATE = 2**28
"""Bytes of a state at most. Origin: assumed; that of 200 signals has a few megabytes."""

STATE_FORM = 1
"""Form in which what is remembered is written. Origin: numerical; counts its versions."""

LAST_PORT = 65535
"""Largest port. Origin: standard, TCP (RFC 9293)."""
