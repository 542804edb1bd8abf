"""What one command needs around its flow: a locked folder, a server, workers."""
