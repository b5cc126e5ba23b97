"""From the tables of a study to the numbers that are reported, each with its interval, its n and its unit."""
