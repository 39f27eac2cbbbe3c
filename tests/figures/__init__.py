"""Figures that the README and the docs print: one ledger, measured again by one command.

`ledger` (docs/figures.yaml as values, where they are printed, numbers without a source), `measure`
(are they older than the code? commands run again, ledger and pages rewritten), `__main__`.
"""
