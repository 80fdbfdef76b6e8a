/* Test double of rcl's simulated time. */

#include <rclcpp/rclcpp.hpp>

#define RCL_RET_OK 0
inline int rcl_enable_ros_time_override(rcl_clock_t *) { return RCL_RET_OK; }
inline int rcl_set_ros_time_override(rcl_clock_t *clock, std::int64_t nanoseconds) {
    clock->now = nanoseconds;
    return RCL_RET_OK;
}
