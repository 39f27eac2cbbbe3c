"""What `rulec watch` survives, measured: `python -m tests.soak`."""
