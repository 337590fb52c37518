"""Tie points near a model: chips, pooled histograms and features, and the models they agree on."""
