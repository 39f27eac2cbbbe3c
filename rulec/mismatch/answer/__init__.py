"""A comparison for people and machines: findings, words, JSON, one HTML file."""
