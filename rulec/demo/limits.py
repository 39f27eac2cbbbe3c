"""Numbers of the live demo, each with its origin."""

ROWS = 360
"""Rows that are played. Origin: assumed; three faults with fault-free readings between them."""

FASTEST = 50.0
"""Largest speed. Origin: assumed; a row every 20 ms, about as fast as three servers in one process
publish."""

STARTING = 30.0
"""Seconds that servers have to start, and the watch to subscribe. Origin: assumed; both take some
seconds on a machine that has other work to do."""

READ_FIRST = 3.0
"""Seconds for which the address of the page stays before the picture covers it. Origin: assumed;
long enough to read a line."""

LAST_ROWS = 1.0
"""Seconds from the last row to the end, for what is still on its way. Origin: assumed; the servers
publish every row's time."""

ENDING = 15.0
"""Seconds that the watch has to end and to write what waits. Origin: assumed; longer than the
outbox of the journal may take to close."""

NOISE = 1
"""Seed of the errors of sensors. Origin: assumed; the first."""

LOOK = 0.1
"""Seconds after which is looked whether a process has ended. Origin: assumed."""
