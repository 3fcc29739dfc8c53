"""Competitive Agglomeration with the fuzzy-maximum-likelihood distance, and Gaussian mixtures."""
