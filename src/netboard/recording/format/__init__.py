"""The MCAP container of a recording: channels, batches of ticks, chunks, older formats."""
