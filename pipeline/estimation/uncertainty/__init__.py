"""Where the uncertainty of a constant comes from, and how it is put together."""
