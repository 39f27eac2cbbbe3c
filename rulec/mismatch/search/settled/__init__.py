"""Sets of explanations of settled points, by their evidence.

Rows are means per operating state and block of time, and every law may have an error of form. All
single explanations and pairs are scanned, and the best sets are refitted.
"""
