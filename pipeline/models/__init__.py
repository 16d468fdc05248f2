"""Models: methods that answer queries faster than the ground truth.

The frame is in this folder: method (interfaces), options, catalogue (which models exist), registry (how they are
loaded), domain (queries that a model was trained on), fallback (answers to all other queries of a scene), bounded,
runtimes, patch_bsdf (directions for a renderer). Each subfolder with an options.py is one model, named as recipes name
it. networks holds layers that several share. added has methods from outside the package.
"""
