"""Practice: exploration noise, the policy update, and paired comparisons."""
