"""Every number of the journal that decides something: its value, its meaning, its origin."""

from __future__ import annotations

SCHEMA = 1
"""Version of the tables; a journal of another version is refused. Origin: numerical."""

LEASE = 15.0
"""Seconds for which a watcher that is silent still counts as watching, where nobody can look
whether its process lives. Origin: assumed; a computer that died is replaced after as long."""

RENEWED = 5.0
"""Seconds after which a watcher without events says that it still watches. Origin: assumed; a third
of `LEASE`."""

BUSY = 5.0
"""Seconds that a transaction waits for another one's lock. Origin: assumed; a transaction takes
milliseconds."""

CONNECT = 5.0
"""Seconds that a server has to take a connection. Origin: assumed."""

SILENT = 10
"""Seconds without an answer to what was sent after which a connection is given up. Origin:
assumed."""

STATEMENT = 30
"""Seconds that a server may take for one statement. Origin: assumed; a batch takes less than one
second."""

BATCH = 500
"""Events read from a database at a time. Origin: assumed; memory alone."""

FIRST_RETRY = 0.2
"""Seconds until what could not be written is tried again first; then twice as long each time.
Origin: assumed."""

LAST_RETRY = 10.0
"""Seconds between two tries at most. Origin: assumed; a journal that is back is used soon."""

MOST_PENDING = 20_000
"""Events that wait to be written at most; then no more are taken. Origin: assumed; at an event
every ten seconds more than two days, 30 MB."""

SPILL_SHARE = 0.1
"""Share of the time that may go into writing pending events to the spill file. Origin: assumed."""

SPILL_PAUSE = 0.05
"""Seconds between two writes of the spill file at least. Origin: assumed."""

LONGEST_TEXT = 4000
"""Characters of a text that is kept of an event at most. Origin: assumed; two screens."""

LONGEST_NAME = 200
"""Characters of the name of who acknowledges, or of a watcher, at most. Origin: assumed."""

LONGEST_LINE = 1 << 20
"""Bytes of a line that is an event at most. Origin: assumed; a text and 10,000 alternatives."""

ANSWER = 5.0
"""Seconds that a broker has to confirm a message, and a server of our own to start or stop.
Origin: assumed."""

STARTING = 60.0
"""Seconds that the server of device health may take to start. Origin: assumed; its standard nodes
take one second of a processor that has nothing else to do."""

KEEP_ALIVE = 10
"""Seconds after which a broker asks whether we are there. Origin: assumed."""

LARGEST_REQUEST = 1 << 20
"""Bytes of a request to the server of device health at most. Origin: assumed; one that asks for
10,000 nodes."""

LARGEST_CERTIFICATE = 1 << 20
"""Bytes of a certificate or key at most. Origin: assumed; they have some thousand."""

LISTED = 40
"""Events that a table shows where no period is asked for. Origin: assumed; two screens."""
