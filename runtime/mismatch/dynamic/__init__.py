"""Where simulation and recording differ in plants that store: states, and some never measured."""
