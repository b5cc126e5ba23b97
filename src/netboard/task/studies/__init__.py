"""Study files: kinds of blocks, factors and order; and the built-in studies."""
