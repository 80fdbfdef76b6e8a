"""Real devices behind the loop: drives on a bus, cameras.

Importing this package loads neither `can` nor `canopen` nor `pysoem` nor `av`; they come with the
extras ``hardware`` and ``ethercat`` and are loaded when a bus or a camera is opened.
"""
