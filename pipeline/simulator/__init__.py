"""The bench simulator: truth to test against.

It imports nothing of this project, so that an error in the models cannot hide in the data that
is used to test them.
"""
