"""The paper's rig and its small sister abc: how well the tool does on recordings of the truth.

Files in order of data flow: `cases` (what is recorded), `judge` (a calibration for every replicate,
recordings to answers), `measure` (answers to figures), `__main__`.
Nothing here knows how the tool decides: it reads the machine form of a diagnosis and the trace.
"""
