"""The pages, one a file, and the charts of those that have many."""
