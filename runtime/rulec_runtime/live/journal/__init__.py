"""Events saved beyond the end of the process, and their sinks."""
