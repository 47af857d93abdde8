"""One physical effect a file; each defines `EFFECT`."""
