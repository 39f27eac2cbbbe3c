"""Is the right fault named first? Counted on recordings of the truth, each table one question.

Files in order of data flow: `tables` (what is recorded), `count` (answers to counts), `__main__`
(the command). Recordings are made and judged as in `tests.rig.mixing_rig`.
"""
