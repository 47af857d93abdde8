"""Mutation tests: change one point of the code, and see whether a test that runs it fails."""
