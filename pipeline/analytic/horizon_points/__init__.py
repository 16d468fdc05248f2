"""Point sampling with a horizon map in place of ray marching: horizon_map, shading, sampler."""
