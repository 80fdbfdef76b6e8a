"""Real devices behind the loop: drives on a bus.

Importing this package loads neither `can` nor `canopen` nor `pysoem`; they come with the extras
``hardware`` and ``ethercat`` and are loaded when a bus is opened.
"""
