"""Light on woven cloth: ground truth, approximations, data sets, scenes, models and their training."""
