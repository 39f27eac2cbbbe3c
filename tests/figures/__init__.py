"""Figures that the README and the docs print: one ledger, measured again by one command.

Files in order of data flow: `share` (counted shares), `ledger` (docs/figures.yaml as values),
`pages` (where a figure is printed, and numbers without a source), `content` (is it older than the
code?), `measure` (commands run again, ledger and pages rewritten), `__main__`.
"""
