"""Limits of the journal, each with its meaning and its origin."""

SCHEMA = 1
"""Version of the tables; a journal of another version is refused. Origin: numerical."""

LEASE = 15.0
"""Seconds for which a silent watcher keeps its plant, if its process cannot be checked. Origin:
assumed; a failed computer can be replaced after that time."""

RENEWED = 5.0
"""Seconds after which a watcher without events renews its lease. Origin: assumed; a third of
`LEASE`."""

BUSY = 5.0
"""Seconds that a transaction waits for a lock. Origin: assumed; one takes milliseconds."""

CONNECT = 5.0
"""Seconds that a server has to accept a connection. Origin: assumed."""

SILENT = 10
"""Seconds without an answer after which a connection is given up. Origin: assumed."""

STATEMENT = 30
"""Seconds that a server may take for one statement. Origin: assumed; a batch takes less than one
second."""

BATCH = 500
"""Events read from a database at a time. Origin: assumed; affects memory alone."""

FIRST_RETRY = 0.2
"""Seconds until a failed write is first retried; then twice as long each time. Origin: assumed."""

LAST_RETRY = 10.0
"""Most seconds between two retries. Origin: assumed; a journal that is back is used soon."""

MOST_PENDING = 20_000
"""Most events that wait to be written; then no more are accepted. Origin: assumed; at an event
every ten seconds more than two days, 30 MB."""

SPILL_SHARE = 0.1
"""Largest share of the time for writing pending events to the spill file. Origin: assumed."""

SPILL_PAUSE = 0.05
"""Least seconds between two writes of the spill file. Origin: assumed."""

LONGEST_TEXT = 4000
"""Most characters of a stored text. Origin: assumed; two screens."""

LONGEST_NAME = 200
"""Most characters of the name of a person or a watcher. Origin: assumed."""

LONGEST_LINE = 1 << 20
"""Most bytes of the line of an event. Origin: assumed; a text and 10,000 alternatives."""

ANSWER = 5.0
"""Seconds that a broker has to confirm a message, and our own server to answer. Origin: assumed."""

STARTING = 60.0
"""Seconds that the device health server may take to start. Origin: assumed; its standard nodes take
one second of an idle processor."""

LARGEST_REQUEST = 1 << 20
"""Most bytes of a request to the device health server. Origin: assumed; one for 10,000 nodes."""

LARGEST_CERTIFICATE = 1 << 20
"""Most bytes of a certificate or key. Origin: assumed; they have some thousand."""

LISTED = 40
"""Events that a table shows if no period is given. Origin: assumed; two screens."""
