"""Structure that no known effect explains: what it depends on, and an expression for it."""
