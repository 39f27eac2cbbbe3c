"""Numbers of the live demo, each with its origin."""

ROWS = 360
"""Rows to play. Origin: assumed; three faults with fault-free readings between them."""

FASTEST = 50.0
"""Largest speed. Origin: assumed; a row every 20 ms, about as fast as three servers in one process
publish."""

READ_FIRST = 3.0
"""Time for which the address of the page stays before the screen covers it, s. Origin: assumed;
long enough to read a line."""

LAST_ROWS = 1.0
"""Time from the last row to the end, for rows in transit, s. Origin: assumed; the servers publish
the time of every row."""

ENDING = 15.0
"""Time for the watch to write its queue and end, s. Origin: assumed; longer than the outbox of the
journal may take to close."""

NOISE = 1
"""Seed of the sensor errors. Origin: assumed; the first."""
