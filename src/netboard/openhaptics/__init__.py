"""Touch, Phantom and their kin, through the library of their maker (HDAPI)."""
