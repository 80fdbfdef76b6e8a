/* What the node and the controller share: the loop, its images, and the topics that report on it. */

#ifndef TAUTSCOPE_CONTROL__SESSION_HPP_
#define TAUTSCOPE_CONTROL__SESSION_HPP_

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <crtk_msgs/msg/operating_state.hpp>
#include <crtk_msgs/msg/string_stamped.hpp>
#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_lifecycle/lifecycle_node.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <sensor_msgs/msg/joint_state.hpp>
#include <std_msgs/msg/float64_multi_array.hpp>
#include <std_msgs/msg/string.hpp>

#include "tautscope_control/control_loop.hpp"
#include "tautscope_control/detection_worker.hpp"

namespace tautscope_control {

/// Control loop with subscription of images or measurements, `state_command`, `measured_js`, `hysteresis/delta`, `operating_state`,
/// `warning` and diagnostics, from configuring a node to cleaning it up.
///
/// Images are received in a callback group of their own and detected in a thread of their own. No callback that still runs uses a
/// session that has ended.
class Session {
public:
    /// Declares the parameters of a node.
    static void declare_parameters(rclcpp_lifecycle::LifecycleNode &node);

    /// From the node's parameters, with topics whose names begin with `prefix`: empty, or "~/". Throws `tautscope::Error` or
    /// `std::invalid_argument`, which say what is wrong in the parameters.
    static std::shared_ptr<Session> create(rclcpp_lifecycle::LifecycleNode &node, const std::string &prefix);

    ~Session();

    Session(const Session &) = delete;
    Session &operator=(const Session &) = delete;

    ControlLoop &control() noexcept { return control_; }

    const std::vector<std::string> &joints() const noexcept { return joints_; }

    /// Seconds since the session began, on the node's clock.
    double now() const { return seconds(clock_->now().nanoseconds()); }

    /// Seconds since the session began of the stamp of a message; of now, if it has none or one of the future.
    double seconds(const builtin_interfaces::msg::Time &stamp) const;

    /// Publishes state, warnings and diagnostics; from a timer, at 10 Hz.
    void report();

    /// A message of the joints, with names and `frame_id`.
    sensor_msgs::msg::JointState joint_state() const;

private:
    Session(rclcpp_lifecycle::LifecycleNode &node, const std::string &prefix);

    double seconds(std::int64_t nanoseconds) const { return 1e-9 * static_cast<double>(nanoseconds - origin_.nanoseconds()); }
    template <class Report> void on_report(const Report &report);
    void on_measurement(const sensor_msgs::msg::JointState &message, const std::string &topic, std::uint32_t sensor);
    void publish_reports();
    void publish_state(const Status &status, const rclcpp::Time &now);
    void publish_diagnostics(const Status &status, const rclcpp::Time &now);

    rclcpp::Clock::SharedPtr clock_;
    rclcpp::Logger logger_;
    std::string name_;
    rclcpp::Time origin_;
    std::string config_, frame_id_;
    ControlLoop control_;
    std::vector<std::string> joints_;
    rclcpp::Publisher<sensor_msgs::msg::JointState>::SharedPtr measured_;
    rclcpp::Publisher<std_msgs::msg::Float64MultiArray>::SharedPtr delta_;
    rclcpp::Publisher<crtk_msgs::msg::OperatingState>::SharedPtr operating_state_;
    rclcpp::Publisher<std_msgs::msg::String>::SharedPtr warning_;
    rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr diagnostics_;
    /// When an image was last used [s].
    std::atomic<double> measured_at_{-1.0};
    Status last_{OperatingState::disabled, TAUTSCOPE_REACTION_NONE, 0, 0, false, false};
    int reports_ = 0;
    /// Of images the worker counts.
    ImageCounts counts_{0, 0, 0, 0};
    std::shared_ptr<DetectionWorker> worker_;
    rclcpp::CallbackGroup::SharedPtr image_group_;
    rclcpp::Subscription<sensor_msgs::msg::Image>::SharedPtr images_;
    std::vector<rclcpp::Subscription<sensor_msgs::msg::JointState>::SharedPtr> sensors_;
    rclcpp::Subscription<crtk_msgs::msg::StringStamped>::SharedPtr state_command_;
};

} // namespace tautscope_control

#endif
