"""Sets of explanations of settled points, by their evidence.

Rows are means per operating state and block of time, every law may be off by an error of form, all
singles and pairs are scanned, and the best sets are refitted together.
"""
