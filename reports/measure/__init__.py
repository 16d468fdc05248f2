"""Measurements of methods; functions return Records, none plots.

On held-out queries: held_out (errors, time, memory), by_size, timing, memory. On views of one fabric:
pictures, frames and aliasing, silhouette. Properties of a method: furnace (energy), extremes, latents. Statistics:
block_bootstrap. In scenes: the folder scene, which also has FLIP, SSIM and PSNR (scene.image_error).
"""
