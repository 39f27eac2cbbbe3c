"""The proof on concealed effects: how far can the answers of `rulec mismatch` be trusted?

Files in order of data flow: `command` (options), `partition` (cases), `campaign` (seal, analyse,
judge; with `analyst`, `run_folder` and `ending`), `judge`, `results` (a judged case, a run),
`scores` (against the goals in `limits`; with `mistakes`), `page` (with `tables` and `pictures`) and
`terminal`. `truth` is the independent simulator.
"""
