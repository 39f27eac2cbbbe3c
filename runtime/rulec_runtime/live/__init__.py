"""Online monitoring: rows come in, events go out.

sources -> follower (diagnosis of all rows so far) -> events (changes) -> journal, view, page.
"""
