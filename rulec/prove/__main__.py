"""`python -m rulec.prove`: the command."""

from rulec.prove.command import main

if __name__ == "__main__":
    raise SystemExit(main())
