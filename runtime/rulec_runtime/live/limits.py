"""Numbers that decide when a plant is watched.

Each states what it means and where it comes from.
"""

KEPT_ROWS = 1024
"""Rows kept at least, readings and all: sensors, noise and settled stretches are judged by them;
twice as many are there before the older half becomes operating points. Origin: assumed; seventeen
stretches of full length, more than a fault takes to be told."""

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

FAILED = 3
"""Exit code where something is active that was asked for with `--fail-on`. Origin: assumed; 1 and 2
are mistakes."""

STATE_FORM = 1
"""Form in which what is remembered is written. Origin: numerical; counts its versions."""

LAST_PORT = 65535
"""Largest port. Origin: standard, TCP (RFC 9293)."""
