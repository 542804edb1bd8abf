"""When things happen: one flow in a file, as short as a paragraph."""
