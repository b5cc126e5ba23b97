"""A thousand million steps, corrupted samples, and the estimators of velocity."""
