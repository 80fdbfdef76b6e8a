"""Drivers for a physical rig: CiA 402 drives on a fieldbus, and cameras.

Importing this package loads neither `can` nor `canopen` nor `pysoem` nor `av`. They come with the
extras ``hardware`` and ``ethercat`` and are loaded when a bus or a camera is opened.
"""
