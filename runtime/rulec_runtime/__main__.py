"""`python -m rulec_runtime` is the command line."""

from rulec_runtime.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
