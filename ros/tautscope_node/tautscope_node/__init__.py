"""ROS 2 node of tautscope with rclpy."""
