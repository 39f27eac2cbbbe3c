"""`python -m rulec.prove.real`: the command on real recordings."""

from rulec.prove.real.command import main

if __name__ == "__main__":
    raise SystemExit(main())
