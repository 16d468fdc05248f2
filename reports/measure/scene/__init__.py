"""Errors of methods in scenes.

shot (frames by the truth and by methods), scene_errors (all measures of a scene), image_error (one picture, with
intervals), flip_ssim (PSNR, SSIM, FLIP, CIEDE2000), fovvideovdp, difference_maps.
"""
