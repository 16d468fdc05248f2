"""Pictures as files and bytes: exr, film (frames as layers), tiles (PNG), differences (error maps)."""
