#include "tautscope_control/session.hpp"

#include <algorithm>
#include <utility>

#include "tautscope_control/messages.hpp"

namespace tautscope_control {

namespace {

/// Without a used image for this long, `measured_js` is invalid [s].
constexpr double measured_timeout = 0.2;
constexpr int reports_per_second = 10;

diagnostic_msgs::msg::KeyValue key_value(std::string key, std::string value) {
    diagnostic_msgs::msg::KeyValue pair;
    pair.key = std::move(key);
    pair.value = std::move(value);
    return pair;
}

std_msgs::msg::MultiArrayDimension dimension(const char *label, std::uint32_t size, std::uint32_t stride) {
    std_msgs::msg::MultiArrayDimension dimension;
    dimension.label = label;
    dimension.size = size;
    dimension.stride = stride;
    return dimension;
}

std::string description(const Status &status) {
    if (status.is_misplaced) {
        return "the drives are not where the last command was: clean up and configure again";
    }
    return std::string(tautscope_reaction_name(status.reaction)) + ": " + flag_names(status.flags | status.latched);
}

} // namespace

std::shared_ptr<Session> Session::create(rclcpp_lifecycle::LifecycleNode &node, const SessionSettings &settings) {
    std::shared_ptr<Session> session(new Session(node, settings));
    session->state_command_ = node.create_subscription<crtk_msgs::msg::StringStamped>(
        settings.prefix + "state_command", rclcpp::QoS(10),
        [weak = std::weak_ptr<Session>(session)](const crtk_msgs::msg::StringStamped &message) {
            const auto session = weak.lock();
            const auto request = parse_state_command(message.string);
            if (session && request) {
                session->control_.post(*request);
            } else if (session) {
                RCLCPP_WARN(session->logger_, "state_command %s: expected enable, disable, pause, resume or acknowledge",
                            message.string.c_str());
            }
        });
    return session;
}

Session::Session(rclcpp_lifecycle::LifecycleNode &node, const SessionSettings &settings)
    : settings_(settings), clock_(node.get_clock()), logger_(node.get_logger()), name_(node.get_fully_qualified_name()),
      origin_(clock_->now()), control_(tautscope::read_file(settings.config)) {
    check_joints(settings_.joints);
    const auto latest = rclcpp::QoS(1);
    const auto latched = rclcpp::QoS(1).transient_local();
    const auto topic = [this](const char *name) { return settings_.prefix + name; };
    // Not those of the lifecycle: the state is published also while the node is not active.
    measured_ = rclcpp::create_publisher<sensor_msgs::msg::JointState>(node, topic("measured_js"), latest);
    delta_ = rclcpp::create_publisher<std_msgs::msg::Float64MultiArray>(node, topic("hysteresis/delta"), latest);
    operating_state_ = rclcpp::create_publisher<crtk_msgs::msg::OperatingState>(node, topic("operating_state"), latched);
    warning_ = rclcpp::create_publisher<std_msgs::msg::String>(node, topic("warning"), latched);
    diagnostics_ = rclcpp::create_publisher<diagnostic_msgs::msg::DiagnosticArray>(node, "/diagnostics", latest);
    worker_ = std::make_shared<DetectionWorker>(
        tautscope::read_file(settings.config), control_.detection(),
        [this](const TautscopeReport &report) { on_report(report); },
        [logger = logger_](const std::string &error) { RCLCPP_ERROR(logger, "Image not used: %s", error.c_str()); });

    image_group_ = node.create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
    rclcpp::SubscriptionOptions options;
    options.callback_group = image_group_;
    // A running callback may outlive the subscription.
    images_ = node.create_subscription<sensor_msgs::msg::Image>(
        settings_.image_topic, rclcpp::SensorDataQoS().keep_last(1),
        [worker = std::weak_ptr<DetectionWorker>(worker_), origin = origin_, logger = logger_,
         clock = clock_](sensor_msgs::msg::Image::ConstSharedPtr message) {
            const rclcpp::Time stamp(message->header.stamp, origin.get_clock_type());
            const double captured_at = 1e-9 * static_cast<double>((stamp - origin).nanoseconds());
            auto received = image(message, captured_at);
            if (!received) {
                RCLCPP_ERROR_THROTTLE(logger, *clock, 1000, "Image not used: encoding %s", message->encoding.c_str());
            } else if (const auto target = worker.lock()) {
                target->offer(std::move(*received));
            }
        },
        options);
    publish_state(control_.status(), clock_->now());
}

// A callback of the images may still hold the worker.
Session::~Session() { worker_->end(); }

double Session::seconds(const builtin_interfaces::msg::Time &stamp) const {
    const rclcpp::Time now = clock_->now();
    const rclcpp::Time time(stamp, now.get_clock_type());
    return seconds(time.nanoseconds() == 0 ? now : std::min(time, now));
}

sensor_msgs::msg::JointState Session::joint_state() const {
    sensor_msgs::msg::JointState message;
    message.header.frame_id = settings_.frame_id;
    message.name = settings_.joints;
    message.position.assign(settings_.joints.size(), 0.0);
    return message;
}

void Session::on_report(const TautscopeReport &report) {
    sensor_msgs::msg::JointState measured = joint_state();
    set_positions(measured, {report.state_estimate[0], report.state_estimate[1], report.state_estimate[2]});
    // CRTK: a stamp of 0 marks what is not valid.
    if (report.status <= TAUTSCOPE_STATUS_PARTIAL) {
        measured.header.stamp = origin_ + rclcpp::Duration::from_seconds(report.captured_at);
        measured_at_ = now();
    }
    measured_->publish(measured);
    std_msgs::msg::Float64MultiArray delta;
    delta.layout.dim = {dimension("insertion,rotation,bending", 3, 6), dimension("minus,plus", 2, 2)};
    for (std::size_t i = 0; i < 3; ++i) {
        delta.data.push_back(report.delta_minus[i]);
        delta.data.push_back(report.delta_plus[i]);
    }
    delta_->publish(delta);
}

void Session::report() {
    const Status status = control_.status();
    const rclcpp::Time now = clock_->now();
    const bool has_changed = status.state != last_.state;
    if (has_changed || reports_ % reports_per_second == 0) {
        publish_state(status, now);
    }
    const bool has_warning = status.is_misplaced || status.latched != 0 || status.flags != 0;
    if (has_warning && (status.flags != last_.flags || status.latched != last_.latched || status.is_misplaced != last_.is_misplaced)) {
        std_msgs::msg::String warning;
        warning.data = description(status);
        warning_->publish(warning);
        RCLCPP_WARN(logger_, "%s", warning.data.c_str());
    }
    if (has_changed || reports_ % reports_per_second == 0) {
        publish_diagnostics(status, now);
    }
    if (seconds(now) - measured_at_ > measured_timeout) {
        measured_->publish(joint_state());
    }
    last_ = status;
    ++reports_;
}

void Session::publish_state(const Status &status, const rclcpp::Time &now) {
    crtk_msgs::msg::OperatingState state;
    state.header.stamp = now;
    state.state = name(status.state);
    // References and commands are absolute.
    state.is_homed = true;
    state.is_busy = false;
    operating_state_->publish(state);
}

void Session::publish_diagnostics(const Status &status, const rclcpp::Time &now) {
    using Level = diagnostic_msgs::msg::DiagnosticStatus;
    Level about;
    about.name = name_ + ": hysteresis reduction";
    about.hardware_id = settings_.frame_id;
    about.message = status.flags == 0 && !status.is_misplaced ? name(status.state) : description(status);
    about.level = status.is_misplaced || status.reaction >= TAUTSCOPE_REACTION_HOLD_MOTION ? Level::ERROR
                  : status.flags != 0 || status.latched != 0                               ? Level::WARN
                                                                                          : Level::OK;
    const ImageCounts images = worker_->counts();
    about.values = {
        key_value("operating_state", name(status.state)),
        key_value("reaction", tautscope_reaction_name(status.reaction)),
        key_value("flags", flag_names(status.flags)),
        key_value("latched", flag_names(status.latched)),
        key_value("images arrived", std::to_string(images.arrived)),
        key_value("images replaced by newer ones", std::to_string(images.replaced)),
        key_value("images used", std::to_string(images.used)),
        key_value("images refused", std::to_string(images.refused)),
    };
    diagnostic_msgs::msg::DiagnosticArray message;
    message.header.stamp = now;
    message.status.push_back(about);
    diagnostics_->publish(message);
}

} // namespace tautscope_control
