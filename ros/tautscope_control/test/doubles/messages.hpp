/* Test double of the messages in use: their fields, without a middleware. */

#ifndef DOUBLES_MESSAGES_HPP
#define DOUBLES_MESSAGES_HPP

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace builtin_interfaces::msg {
struct Time {
    std::int32_t sec = 0;
    std::uint32_t nanosec = 0;
};
} // namespace builtin_interfaces::msg

namespace std_msgs::msg {
struct Header {
    builtin_interfaces::msg::Time stamp;
    std::string frame_id;
};
struct MultiArrayDimension {
    std::string label;
    std::uint32_t size = 0, stride = 0;
};
struct MultiArrayLayout {
    std::vector<MultiArrayDimension> dim;
};
struct Float64MultiArray {
    MultiArrayLayout layout;
    std::vector<double> data;
};
struct String {
    std::string data;
};
} // namespace std_msgs::msg

namespace sensor_msgs::msg {
struct JointState {
    std_msgs::msg::Header header;
    std::vector<std::string> name;
    std::vector<double> position;
};
struct Image {
    using ConstSharedPtr = std::shared_ptr<const Image>;
    std_msgs::msg::Header header;
    std::uint32_t height = 0, width = 0, step = 0;
    std::string encoding;
    std::vector<std::uint8_t> data;
};
} // namespace sensor_msgs::msg

namespace crtk_msgs::msg {
struct StringStamped {
    std_msgs::msg::Header header;
    std::string string;
};
struct OperatingState {
    std_msgs::msg::Header header;
    std::string state;
    bool is_homed = false, is_busy = false;
};
} // namespace crtk_msgs::msg

namespace diagnostic_msgs::msg {
struct KeyValue {
    std::string key, value;
};
struct DiagnosticStatus {
    enum : std::uint8_t { OK, WARN, ERROR };
    std::uint8_t level = OK;
    std::string name, message, hardware_id;
    std::vector<KeyValue> values;
};
struct DiagnosticArray {
    std_msgs::msg::Header header;
    std::vector<DiagnosticStatus> status;
};
} // namespace diagnostic_msgs::msg

namespace rcl_interfaces::msg {
struct SetParametersResult {
    bool successful = false;
    std::string reason;
};
} // namespace rcl_interfaces::msg

namespace lifecycle_msgs::msg {
struct State {
    enum : std::uint8_t {
        PRIMARY_STATE_UNCONFIGURED = 1,
        PRIMARY_STATE_INACTIVE,
        PRIMARY_STATE_ACTIVE,
        PRIMARY_STATE_FINALIZED,
    };
};
} // namespace lifecycle_msgs::msg

#endif
