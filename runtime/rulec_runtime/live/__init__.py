"""Beside the plant: rows come in, events go out.

sources -> follower (what all rows say so far) -> events (what has changed) -> journal, view, page.
"""
