"""Errors of methods in scenes.

shot (frames by the truth and by methods), scene_errors (all measures of a scene; FovVideoVDP), image_error (one
picture, with intervals: PSNR, SSIM, FLIP, CIEDE2000).
"""
