"""Is the right fault named first? Counted on recordings of the truth, each table one question."""
