"""Gates: one file each, one GATE each."""
