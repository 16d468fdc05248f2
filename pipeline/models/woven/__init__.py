"""`woven`: one network for many fabrics at many scales [Chen2024Woven]."""
