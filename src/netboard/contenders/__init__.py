"""Who takes part in the work-precision study: our own methods, and the libraries beside them."""
