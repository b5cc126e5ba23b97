"""Cost of an analysis, and the sensitivity of its results to open questions and disturbances."""
