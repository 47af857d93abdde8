"""Which known effects the data ask for: score tests, stepwise search, pruning, alternatives."""
