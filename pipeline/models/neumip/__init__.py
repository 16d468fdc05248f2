"""`neumip`: a neural texture of one fabric at all scales [Kuznetsov2021NeuMIP]."""
