"""A diagnosis for people and machines: terminal, JSON, one self-contained HTML file."""
