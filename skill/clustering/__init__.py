"""Competitive Agglomeration with the fuzzy-maximum-likelihood distance, and the merging of Gaussian mixtures."""
