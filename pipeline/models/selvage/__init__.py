"""`selvage`: soft nodes corrected by a residual perceptron; our own model, with its pretrained weights."""
