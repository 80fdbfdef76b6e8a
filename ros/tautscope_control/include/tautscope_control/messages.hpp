/* Conversions between messages and the control loop. */

#ifndef TAUTSCOPE_CONTROL__MESSAGES_HPP_
#define TAUTSCOPE_CONTROL__MESSAGES_HPP_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <sensor_msgs/msg/image.hpp>
#include <sensor_msgs/msg/joint_state.hpp>

#include "tautscope_control/control_loop.hpp"
#include "tautscope_control/detection_worker.hpp"

namespace tautscope_control {

/// Names of the article's joints.
inline const std::vector<std::string> default_joints{"insertion", "rotation", "bending"};

/// The joints' names by the parameter; of a robot with `[[dof]]` by default those of its degrees of freedom. Throws
/// `std::invalid_argument` unless they are different, one per degree of freedom.
std::vector<std::string> joints_of(std::vector<std::string> names, const ControlLoop &control);

/// A stamp in ns, which may be negative: `rclcpp::Time` throws then.
inline std::int64_t nanoseconds(const builtin_interfaces::msg::Time &stamp) noexcept {
    return stamp.sec * 1'000'000'000LL + stamp.nanosec;
}

/// Positions of the joints, by their names; by their order where the message has no names. NaN for one that is missing.
Values positions(const sensor_msgs::msg::JointState &message, const std::vector<std::string> &joints);

/// Writes positions into a message of these joints.
void set_positions(sensor_msgs::msg::JointState &message, Numbers positions);

/// An image of its message, without a copy. None if the encoding is not one of bgr8, rgb8, bgra8, yuv422_yuy2, uyvy, yuv422,
/// nv12.
std::optional<OwnedImage> image(sensor_msgs::msg::Image::ConstSharedPtr message, double captured_at);

} // namespace tautscope_control

#endif
