"""A study as its file describes it: kinds of blocks, factors, order; and the studies that come with netboard."""
