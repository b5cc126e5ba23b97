"""Work and precision of the integrators, beside other libraries."""
