"""Every constant of judgement of criticism, by package, with unit, meaning and origin."""
