"""One command: the folder that it holds, its server, its workers."""
