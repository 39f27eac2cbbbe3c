"""The node id of an item in a list of sources, as a source map writes it."""

import re
from base64 import b64decode
from uuid import UUID

_WHOLE = re.compile(r"(nsu=[^;]+;|ns=\d+;)?([isgb])=(.+)", re.DOTALL)
_KINDS = {"byte": "i", "short": "i", "int": "i", "long": "i", "integer": "i"} | {
    "id": "g",
    "base64binary": "b",
}
"""Kind of node id by the end of the data type of an identifier: `xs:ID` is a GUID."""


def node_id(identifier: str, namespace: str, data_type: str = "") -> str:
    """A node id as a source map writes it; a namespace is a URI, or a number in older files.

    Raises ValueError that says what is wrong with the identifier.

    >>> node_id("A.dp", "http://maker/pump"), node_id("A.dp", "4"), node_id("ns=3;s=A.dp", "3")
    ('nsu=http://maker/pump;s=A.dp', 'ns=4;s=A.dp', 'ns=3;s=A.dp')
    >>> node_id("17", "4", "xs:unsignedInt"), node_id("i=17", "")
    ('ns=4;i=17', 'i=17')
    >>> node_id("{72962B91-FA75-4AE6-8D28-B404DC7DAF63}", "4", "xs:ID")
    'ns=4;g=72962b91-fa75-4ae6-8d28-b404dc7daf63'
    >>> node_id("M/RbKBsRVkePCePcx24oRA==", "4", "xs:base64Binary")
    'ns=4;b=M/RbKBsRVkePCePcx24oRA=='
    """
    if not identifier:
        raise ValueError("no identifier")
    whole = _WHOLE.fullmatch(identifier)
    if whole:
        own, kind, value = whole.groups()
    else:
        kinds = (kind for end, kind in _KINDS.items() if data_type.lower().endswith(end))
        own, kind, value = None, next(kinds, "s"), identifier
    try:
        if kind == "i" and not (value.isdecimal() and int(value) < 1 << 32):
            raise ValueError
        if kind == "g":
            value = str(UUID(value))
        if kind == "b":
            value = value.replace(" ", "")
            b64decode(value, validate=True)
    except ValueError:
        what = {"i": "a whole number of 32 bits", "g": "a GUID", "b": "base64"}[kind]
        what_type = f" of type {data_type}" if not whole else ""
        raise ValueError(f"the identifier '{identifier}'{what_type}, which is not {what}") from None
    if own is None and namespace:
        own = f"{'ns' if namespace.isdigit() else 'nsu'}={namespace};"
    return f"{own or ''}{kind}={value}"
