"""Real rigs: how the tool does on recordings nobody made for it."""
