"""One exporter a file; the registry finds them."""
