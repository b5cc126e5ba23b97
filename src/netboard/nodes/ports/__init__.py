"""The server's ends of the channels: peers, samples, forces, commands, views and the lossless log."""
