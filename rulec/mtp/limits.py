"""Numbers that decide what of a Module Type Package is read, each with its origin."""

# Containers

LARGEST_FILE = 32 << 20
"""Bytes of a file that is read at most. Origin: assumed; forty times the largest of ten real
ones."""

LARGEST_UNPACKED = 32 << 20
"""Bytes that the XML files of one container may unpack to. Origin: assumed; as `LARGEST_FILE`."""

LARGEST_RATIO = 200
"""Bytes unpacked per byte packed at most. Origin: assumed; real ones pack to a twentieth at best,
and deflate ends at 1032."""

MOST_MEMBERS = 2000
"""Members of a container at most. Origin: assumed; real ones have up to three, and pictures."""

MOST_MANIFESTS = 50
"""XML files of a container at most. Origin: assumed; as `MOST_MEMBERS`."""

# XML

DEEPEST = 60
"""Elements inside one another at most. Origin: assumed; real files have up to ten."""

MOST_ELEMENTS = 1_000_000
"""Elements of one file at most. Origin: assumed; real files have up to 20,000."""

MOST_KEPT = 200_000
"""Elements of a container that are kept at most, without class libraries. Origin: assumed; memory,
100 MB."""

LONGEST_TEXT = 1 << 16
"""Characters of one value or attribute at most. Origin: assumed; real ones have some hundred."""

LONGEST_NAME = 300
"""Characters of a name, an identifier or a unit at most. Origin: assumed; five times the longest of
ten real files."""

# What is made of it

LONGEST_SIGNAL = 40
"""Characters of the name of a signal or of a module in a plant at most. Origin: standard,
kb/schema/module.schema.json, with one letter to spare."""

LONGEST_MODULE = 60
"""Characters of the name of a module type at most. Origin: standard, kb/schema/module.schema.json,
with one letter to spare."""

MOST_TOLD = 5
"""Oddities of one kind that are shown of a file; the others are counted. Origin: assumed."""

MOST_TAGS = 20_000
"""Tags of a module at most. Origin: assumed; real ones have up to some hundred."""

MOST_DRAWN = 1000
"""Symbols, or pipes, of a picture up to which it is looked where pipes end. Origin: assumed."""

MOST_LISTED = 2000
"""Tags, services or connections that a skeleton lists at most. Origin: assumed; the file stays
shorter than a YAML file may be."""

NEAR_SYMBOL = 0.5
"""How far the end of a pipe may lie from the edge of a symbol to lead there, as a share of the
symbol's smaller side. Origin: assumed; in real pictures pipes end within the box or a few pixels
off."""

# Asking the controller

ONLINE = 20.0
"""Seconds in which a server must have answered for all units and ranges. Origin: assumed; some
hundred values need a few requests."""
