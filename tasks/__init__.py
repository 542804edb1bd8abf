"""How the stages work: chunks that are cached, tracked and sent to workers."""
