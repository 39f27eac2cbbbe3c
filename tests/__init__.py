"""Tests of the tool.

Hundreds of plants are compiled of the same module types: what sympy worked out for the first is
still there for the last. It reads this variable when it is imported.
"""

import os

os.environ.setdefault("SYMPY_CACHE_SIZE", "30000")
