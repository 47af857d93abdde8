"""What is shown of a result, made once: page, terminal and recording draw the same records."""
