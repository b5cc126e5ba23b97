"""What an analysis costs, and how open questions and disturbances move its numbers."""
