"""Work and precision of the integrators, compared with other libraries."""
