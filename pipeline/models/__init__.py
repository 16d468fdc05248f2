"""Models: what answers queries without the cost of the ground truth.

The frame is in this folder: method (interfaces), options, catalogue (which models exist), registry (how they are
loaded), domain (what a model was trained on), fallback (what answers outside of it), bounded, runtimes, sampler.
Each subfolder with an options.py is one model, named as recipes name it. networks holds layers that several share.
"""
