"""On the path of a measurement, to note which files it uses; Python imports it by its name."""
