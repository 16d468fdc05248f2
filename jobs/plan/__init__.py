"""A recipe as the list of its tasks; made without any library that does the work."""
