"""Recordings in other formats: Parquet, CSV, MATLAB, Motion-BIDS, NWB, XDF."""
