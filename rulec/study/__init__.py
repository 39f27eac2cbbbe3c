"""How well does a ruleset diagnose? Simulated recordings, judged and counted.

In order of data flow: operating points, campaign (which recordings, in parallel), judge (one
recording), tally (counts), summary (words).
"""
