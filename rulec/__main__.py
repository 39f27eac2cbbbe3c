"""`python -m rulec` is the command line."""

from rulec.cli import main

raise SystemExit(main())
