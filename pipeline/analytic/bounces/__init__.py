"""Light that yarns give to each other: the second and all further bounces, as one small table of a cloth."""
