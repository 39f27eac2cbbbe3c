"""The long run: faults that grow, readings that fail, plants that are partly blind.

`plants` has rigs, recordings, the tool asked and what is right; then come the four questions
`rows`, `courses`, `pairs` and `year`, and the command `python -m tests.rig.long_run`. Recordings
come from `rulec.prove.truth`, which shares no code with the packages under test.
"""
