"""A simulated rig for another process: CiA 402 drives on a CAN bus, and a camera stream."""
