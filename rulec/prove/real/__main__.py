"""`python -m rulec.prove.real`: the command for real recordings."""

from __future__ import annotations

from rulec.prove.__main__ import main

if __name__ == "__main__":
    raise SystemExit(main("rulec.prove.real.command"))
