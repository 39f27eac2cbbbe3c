"""What `rulec mismatch` names rightly: effects of the catalogue planted into simulated plants.

The recordings come from the tool's own equations with an effect built in, so this measures the
search, its rivals and its uncertainties, not the catalogue (that is what `rulec prove` is for).
"""
