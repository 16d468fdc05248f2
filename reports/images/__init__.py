"""Pictures as files and bytes: exr (frames as layers), tiles (PNG, tone curves, MP4)."""
