"""How long the loop from stylus to force takes, and how steadily: beside what the transport itself takes."""
