"""Search for what may explain a recording, by the gain of each explanation."""
