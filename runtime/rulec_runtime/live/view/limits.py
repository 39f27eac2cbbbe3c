"""Numbers that decide how and how often the plant is shown.

Each states what it means and where it comes from.
"""

REDRAWN = 0.2
"""How soon the terminal shows what is new, and how often keys are looked for, s. Origin: assumed;
nobody reads faster, and drawing costs some 20 ms."""

TICK = 1.0
"""How often the age of the last row, and what rows alone change, is told anew, s. Origin: assumed;
ages are told in seconds."""

SILENT = 6.0
"""After how long without a word from the server a page says that the connection is lost, s.
Origin: assumed; six heartbeats, one a `TICK`."""

RETRY = 2.0
"""How long a page waits before it asks for a new connection, s. Origin: assumed."""

STATIC = 10
"""How often a browser without scripts loads the page again, s. Origin: assumed."""

MOST_STREAMS = 32
"""Pages that are kept up to date at the same time. Origin: assumed; a control room and its
telephones. Each costs a connection."""

MOST_CONNECTIONS = 128
"""Connections at the same time; more are refused with 503. Origin: assumed; four a page."""

MOST_OF_AN_ADDRESS = 64
"""Connections of one address at the same time. Origin: assumed; half of `MOST_CONNECTIONS`, since
all who come through a proxy have its address."""

ASKING = 5.0
"""How long a connection may take to send a whole request, s. Origin: assumed; as long as the server
keeps one open that asks nothing more."""

LONGEST_FORM = 4096
"""Bytes that a form may have. Origin: assumed; a key and a token have a hundred."""

GONE = 20.0
"""After how long without an answer a page that was sent something counts as gone, s. Origin:
assumed; a telephone that left the network must not keep its place among `MOST_STREAMS`."""

SHORTEST_TOKEN = 16
"""Characters of a token at least, where the page can be reached from other machines. Origin:
assumed; sixteen random letters cannot be guessed over a network."""

LATEST_EVENTS = 50
"""Past events on a page. Origin: assumed; the journal has all."""

BAR_ENDS = 3.0
"""Where the bar of a residual ends, in thresholds. Origin: assumed; what is further off is off."""

PAST = 500
"""Latest events that can be looked at. Origin: assumed; the journal has all."""
