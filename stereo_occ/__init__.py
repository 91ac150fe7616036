"""Stereo Occupancy Networks: the full 3D shape of a household object from one calibrated stereo pair."""

__version__ = "0.1.0"
