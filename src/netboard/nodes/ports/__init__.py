"""The server's endpoints of the channels: peers, samples, forces, commands, views and the lossless log."""
