"""Models: methods that answer queries faster than the ground truth.

The frame is in this folder: method and network (interfaces), options, catalogue (which models exist), registry (how
they are loaded), named (names on the command line), card (files of trained models), domain (queries that a model was
trained on), fallback (answers to all other queries of a scene), bounded, runtimes, patch_bsdf (directions for a
renderer). analytic has the models that learn nothing, one a file. Each subfolder with a model.py is a model that
learns; its options are in the package itself. networks holds layers that several share. added has methods from outside.
"""
