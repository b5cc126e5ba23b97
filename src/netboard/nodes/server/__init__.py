"""The physics server: sessions, ticks, attempts, blocks, operator commands and supervision."""
