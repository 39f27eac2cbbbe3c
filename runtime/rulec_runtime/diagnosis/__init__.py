"""From a recording to a diagnosis: sensors first, then settled stretches, or windows of a store."""
