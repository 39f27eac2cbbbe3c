"""Module Type Packages: read, imported, refused."""
