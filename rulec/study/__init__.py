"""How well does a ruleset diagnose? Simulated recordings, judged and counted.

In order of data flow: operating points, campaign (which recordings), judge (one recording), pool
(many, in parallel), tally (counts), summary (words).
"""
