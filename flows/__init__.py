"""When things happen: one verb, one file, one paragraph."""
