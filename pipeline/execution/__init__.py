"""Work on many files and motors with several workers: executors, retries, caches."""
