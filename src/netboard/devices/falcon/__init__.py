"""The Novint Falcon over USB, without the manufacturer's driver."""
