"""HTML pages of motors, fleets, lots, comparisons and diagnoses."""
