"""What happened, kept beyond the end of the process: one table of events."""
