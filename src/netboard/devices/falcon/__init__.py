"""The Novint Falcon over USB, without its maker's driver."""
