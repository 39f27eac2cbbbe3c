"""How certain the explanations are, and their proof on samples held out."""
