"""How often a fault comes, as prior odds."""

FREQUENCY_ODDS = {"common": 10.0, "usual": 1.0, "rare": 0.1}
"""Prior odds of a fault by the word for how often it comes, over one that comes as usual. Origin:
assumed; steps of ten, as the words stand for orders of magnitude and for no counts."""
