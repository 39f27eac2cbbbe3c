"""A comparison of simulation and recording as one self-contained HTML file."""
