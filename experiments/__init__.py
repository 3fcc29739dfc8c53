"""What is done with the diagrams: demonstrations, trials, corrections, sweeps and their scores."""
