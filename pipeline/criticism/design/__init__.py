"""Which further test would part two effects."""
