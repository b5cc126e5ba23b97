"""What happens when things break: real processes, harmed on purpose, and what must follow."""
