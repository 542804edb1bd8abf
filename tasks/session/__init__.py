"""What one command needs around its flow: its locked folder, its server, its workers."""
