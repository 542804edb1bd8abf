"""What the figures decide: claims, comparisons of runs, promotion, drift."""
