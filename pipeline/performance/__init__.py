"""From the constants of a datasheet to its numbers: curves, ratings, losses, with intervals."""
