"""Mixtures: Gaussian and Student components, expectation-maximisation, and the effective sample size."""
