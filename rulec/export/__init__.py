"""Observers as code for module controllers: a small program form, its interpreter and printers."""
