"""The language of module and plant files: text to checked parts, each mistake with its place."""
