"""An experiment: names by the evidence of sets of explanations, on settled points of sealed cases.

Rows are means per operating state and block of time, every law may be off by an error of form, all
singles and pairs are scanned, and the best sets are refitted together. The laws, their residuals
and slopes are those of `rulec.mismatch.evidence.steady`; nothing of its search is used.
"""
