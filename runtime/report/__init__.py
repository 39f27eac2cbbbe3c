"""A diagnosis as one self-contained HTML file, with the pictures of the seed paper."""
