"""What a comparison of simulation and recording found, as data."""
