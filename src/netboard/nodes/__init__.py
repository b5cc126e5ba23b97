"""The loops: one module per process, wired up by the services."""
