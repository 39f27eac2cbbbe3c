"""Explanations added one after the other, as long as each beats its rivals."""
