"""Measurements of the ground truth itself: accuracy, bias, effort, throughput, sampling, stability, frames."""
