"""Export of recordings to other formats: Parquet, CSV, MATLAB, Motion-BIDS, NWB, XDF."""
