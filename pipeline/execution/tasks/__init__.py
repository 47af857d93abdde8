"""What a worker does: identify a file, read captures, make a datasheet."""
