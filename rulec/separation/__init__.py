"""Active diagnosis: the change of set points that tells faults apart."""
