"""The equation of one kind of test a file; each defines `EQUATION`."""
