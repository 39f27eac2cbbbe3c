"""The proof on concealed effects: how far can the answers of `rulec mismatch` be trusted?

Files in order of data flow: `command` (options), `partition` (cases), `campaign` (seal, analyse,
judge; with `analyst`), `judge`, `results` (a judged case, a run), `scores` (against the goals in
`limits`), `tables` and `page` (also the terminal). `second_round` runs plants again,
`real` is for real recordings. `truth` is the independent simulator.
"""
