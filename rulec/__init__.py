"""The compiler: from module descriptions and a plant to a ruleset.

Reading order: `pipeline.py` names the passes; each pass is a file of the same name.
"""
