"""The effects there are: found as plug-ins or in files of a user, and models by name."""
