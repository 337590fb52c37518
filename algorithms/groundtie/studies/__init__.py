"""Comparisons of methods: optimisers, detectors, measures. No registering tool uses them."""
