"""Counts in English."""


def plural(count: int, one: str, many: str) -> str:
    """A count with its noun, and perhaps its verb.

    >>> plural(1, "row has", "rows have"), plural(3, "row has", "rows have")
    ('1 row has', '3 rows have')
    """
    return f"{count} {one if count == 1 else many}"
