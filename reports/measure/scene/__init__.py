"""Measurements in scenes: frames (queries and the truth), errors, image_error (FLIP, SSIM), fovvideovdp."""
