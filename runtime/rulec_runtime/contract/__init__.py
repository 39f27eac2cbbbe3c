"""What the compiler hands over: the ruleset, its plan, and exact derivatives of it."""
