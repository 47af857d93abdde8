"""Whether a production lot still makes the same motor: statistics over many datasheets."""
