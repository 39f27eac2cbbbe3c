"""Active diagnosis: changes of set points that tell faults apart."""
