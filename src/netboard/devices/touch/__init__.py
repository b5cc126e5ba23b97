"""Touch, Touch X, Phantom and related devices, through the vendor's OpenHaptics library."""
