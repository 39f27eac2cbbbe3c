"""Events kept beyond the end of the process."""
