"""Models, tests, confidence intervals and effect sizes for few dyads."""
