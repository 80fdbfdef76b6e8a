#include "tautscope_control/messages.hpp"

#include <algorithm>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

namespace tautscope_control {

std::vector<std::string> joints_of(std::vector<std::string> names, const ControlLoop &control) {
    if (!control.has_bands() && names == default_joints) {
        names = control.dofs();
    }
    const std::size_t count = control.dofs().size();
    if (names.size() != count || std::set<std::string>(names.begin(), names.end()).size() != count) {
        throw std::invalid_argument("Parameter joints: got " + std::to_string(names.size()) + " names, expected " +
                                    std::to_string(count) + " different ones, one for each degree of freedom.");
    }
    return names;
}

Values positions(const sensor_msgs::msg::JointState &message, const std::vector<std::string> &joints) {
    Values values(joints.size(), std::numeric_limits<double>::quiet_NaN());
    if (message.name.empty() && message.position.size() == joints.size()) {
        return Values(message.position);
    }
    for (std::size_t i = 0; i < joints.size(); ++i) {
        const auto found = std::find(message.name.begin(), message.name.end(), joints[i]);
        const auto index = static_cast<std::size_t>(found - message.name.begin());
        if (found != message.name.end() && index < message.position.size()) {
            values[i] = message.position[index];
        }
    }
    return values;
}

void set_positions(sensor_msgs::msg::JointState &message, Numbers positions) {
    message.position.assign(positions.data(), positions.data() + positions.size());
}

std::optional<OwnedImage> image(sensor_msgs::msg::Image::ConstSharedPtr message, double captured_at) {
    static const std::pair<const char *, TautscopePixelFormat> formats[] = {
        {"bgr8", TAUTSCOPE_PIXEL_FORMAT_BGR},         {"rgb8", TAUTSCOPE_PIXEL_FORMAT_RGB},
        {"bgra8", TAUTSCOPE_PIXEL_FORMAT_BGRA},       {"yuv422_yuy2", TAUTSCOPE_PIXEL_FORMAT_YUYV},
        {"uyvy", TAUTSCOPE_PIXEL_FORMAT_UYVY},        {"yuv422", TAUTSCOPE_PIXEL_FORMAT_UYVY},
        {"nv12", TAUTSCOPE_PIXEL_FORMAT_NV12},
    };
    for (const auto &[encoding, format] : formats) {
        if (message->encoding == encoding) {
            OwnedImage image{{}, captured_at, message};
            image.view.data = message->data.data();
            image.view.length = message->data.size();
            image.view.stride = message->step;
            image.view.width = message->width;
            image.view.height = message->height;
            image.view.format = static_cast<std::uint32_t>(format);
            return image;
        }
    }
    return std::nullopt;
}

} // namespace tautscope_control
