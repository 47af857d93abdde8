"""Pure rendering of datasheets and evidence into text; writing is `io`'s."""
