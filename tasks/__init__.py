"""How each stage is done: one chunk of it, cached, tracked and sent to workers."""
