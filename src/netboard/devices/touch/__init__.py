"""Touch, Touch X, Phantom and their kin, through the vendor's OpenHaptics library."""
