"""Features of the wrench and the depth."""
