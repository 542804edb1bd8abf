"""The dashboard: pages over a data folder, rendered on the server, every state of them an address."""
