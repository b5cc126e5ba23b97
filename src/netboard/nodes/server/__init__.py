"""The physics server: sessions, their ticks, attempts, blocks, commands and supervision."""
