"""The proof on concealed effects: how far can the answers of `rulec mismatch` be trusted?

Files in order of data flow: `command` (options), `partition` (which cases), `campaign` (seal,
analyse, judge; with `analyst`, `run_folder` and `ending`), `judge`, `results` (a judged case, a
run), `attainable` (what could be reached at best), `scores` (against the goals in `limits`; with
`mistakes` and `calibration`), `page` (with `tables` and `pictures`) and `terminal`. `baselines`
(with `aligned`, `trees` and `sparse`) learn the residual instead: they predict and name nothing.
`truth` is the independent simulator.
"""
