"""Who is met: the terminal, pages, reports, Gymnasium, other programs."""
