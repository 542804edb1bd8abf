"""One file a page: what the address asked for in, a ``Page`` out."""
