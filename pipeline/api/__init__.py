"""The public functions and their results: what `import pipeline` offers."""
