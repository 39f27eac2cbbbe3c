"""The long run: faults that grow, readings that fail, plants that are partly blind.

Files in order of data flow: `physics` (pumps that stand or run dry, cold liquid), `readings` (what
goes wrong with a column), `plants` (rigs, recordings, the tool asked), `judged` (what is right),
then the four questions `rows`, `courses`, `pairs` and `year`, and the command
`python -m tests.rig.long_run`. Recordings come from `rulec.prove.truth`, which shares no code with
the packages under test.
"""
