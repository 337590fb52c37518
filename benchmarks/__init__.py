"""Benchmarks: accuracy on real and simulated pairs, speed against peers; see README.md."""
