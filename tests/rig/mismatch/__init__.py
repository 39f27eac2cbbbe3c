"""Acceptance of `rulec mismatch` on real recordings: what is named, and what it is worth.

The tool runs as a process of its own, on plants and recordings in a temporary folder. Labels only
score. `python -m tests.rig.mismatch` prints the figures; beside each stands what a person found
in the same recording by hand.
"""
