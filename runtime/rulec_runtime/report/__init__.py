"""Present a diagnosis to people and machines: terminal, JSON, one self-contained HTML file."""
