"""The language of module and plant files: text to checked parts, every mistake with its place."""
