"""The passes of the compiler, in the order of `pipeline.py`."""
