"""Many files and motors over several workers: who works, what survives, what is remembered."""
