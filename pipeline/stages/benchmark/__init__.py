"""The blind benchmark: sealed simulated campaigns, a diagnosis that sees recordings only, marks."""
