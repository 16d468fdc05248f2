"""Pictures as files and bytes: exr, film (frames as layers), tiles (PNG), tone (tone curves), video (MP4)."""
