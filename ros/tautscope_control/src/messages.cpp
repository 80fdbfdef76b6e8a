#include "tautscope_control/messages.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

namespace tautscope_control {

void check_joints(const std::vector<std::string> &joints) {
    if (joints.size() != 3 || std::set<std::string>(joints.begin(), joints.end()).size() != 3) {
        throw std::invalid_argument("Parameter joints: expected three different names, of insertion, rotation and bending.");
    }
}

std::optional<Vector> positions(const sensor_msgs::msg::JointState &message, const std::vector<std::string> &joints) {
    Vector values{};
    if (message.name.empty()) {
        if (message.position.size() != values.size()) {
            return std::nullopt;
        }
        std::copy(message.position.begin(), message.position.end(), values.begin());
        return values;
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
        const auto found = std::find(message.name.begin(), message.name.end(), joints[i]);
        const auto index = static_cast<std::size_t>(found - message.name.begin());
        if (found == message.name.end() || index >= message.position.size()) {
            return std::nullopt;
        }
        values[i] = message.position[index];
    }
    return values;
}

void set_positions(sensor_msgs::msg::JointState &message, const Vector &positions) {
    message.position.assign(positions.begin(), positions.end());
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
