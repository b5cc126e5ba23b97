"""Stability limits of the integration methods and of the loop with each velocity estimator."""
