"""Figures that the README and the docs print: one ledger, measured again by one command.

Files in order of data flow: `ledger` (docs/figures.yaml as values), `pages` (where a figure is
printed, and numbers that nobody answers for), `content` (is it older than the code?),
`sources` and `traced` (which files a command used), `plain_code` (what of them computes),
`commands` (measured again), `change` (ledger and pages rewritten), `share` (counted shares),
`__main__`.
"""
