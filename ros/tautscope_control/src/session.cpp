#include "tautscope_control/session.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
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

std_msgs::msg::MultiArrayDimension dimension(const std::string &label, std::uint32_t size, std::uint32_t stride) {
    std_msgs::msg::MultiArrayDimension dimension;
    dimension.label = label;
    dimension.size = size;
    dimension.stride = stride;
    return dimension;
}

std::string joined(const std::vector<std::string> &names) {
    std::string text;
    for (const std::string &name : names) {
        text += text.empty() ? name : ", " + name;
    }
    return text;
}

bool is_refused(const Status &status) { return status.is_misplaced || status.is_unmeasured; }

std::string description(const Status &status) {
    if (status.is_misplaced) {
        return "the drives are not where the last command was: clean up and configure again";
    }
    if (status.is_unmeasured) {
        return "enable is refused: it is not known where the drives are";
    }
    return std::string(tautscope_reaction_name(status.reaction)) + ": " + flag_names(status.flags | status.latched);
}

} // namespace

void Session::declare_parameters(rclcpp_lifecycle::LifecycleNode &node) {
    const auto declare = [&node](const char *name, const auto &value) {
        // The overrides of a controller may be declared already.
        if (!node.has_parameter(name)) {
            node.declare_parameter(name, value);
        }
    };
    declare("config", std::string());
    declare("joints", default_joints);
    declare("image_topic", std::string("/endoscope/image_raw"));
    declare("measurement_topics", std::vector<std::string>());
    declare("frame_id", std::string("guide"));
    declare("compensation", 1.0);
}

std::shared_ptr<Session> Session::create(rclcpp_lifecycle::LifecycleNode &node, const std::string &prefix) {
    std::shared_ptr<Session> session(new Session(node, prefix));
    session->state_command_ = node.create_subscription<crtk_msgs::msg::StringStamped>(
        prefix + "state_command", rclcpp::QoS(10),
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
    const auto topics = node.get_parameter("measurement_topics").as_string_array();
    for (std::uint32_t sensor = 0; sensor < topics.size() && !session->control_.has_bands(); ++sensor) {
        session->sensors_.push_back(node.create_subscription<sensor_msgs::msg::JointState>(
            topics[sensor], rclcpp::SensorDataQoS().keep_last(10),
            [weak = std::weak_ptr<Session>(session), topic = topics[sensor], sensor](const sensor_msgs::msg::JointState &message) {
                if (const auto session = weak.lock()) {
                    session->on_measurement(message, topic, sensor);
                }
            }));
    }
    return session;
}

Session::Session(rclcpp_lifecycle::LifecycleNode &node, const std::string &prefix)
    : clock_(node.get_clock()), logger_(node.get_logger()), name_(node.get_fully_qualified_name()), origin_(clock_->now()),
      config_(tautscope::read_file(node.get_parameter("config").as_string())),
      frame_id_(node.get_parameter("frame_id").as_string()), control_(config_),
      joints_(joints_of(node.get_parameter("joints").as_string_array(), control_)) {
    const std::size_t topics = node.get_parameter("measurement_topics").as_string_array().size();
    if (!control_.has_bands() && (topics < 1 || topics > 4)) {
        throw std::invalid_argument("Parameter measurement_topics: got " + std::to_string(topics) +
                                    " topics, expected 1 to 4 of sensor_msgs/JointState, for a robot with [[dof]].");
    }
    if (!control_.set_compensation(node.get_parameter("compensation").as_double())) {
        throw std::invalid_argument("Parameter compensation: expected a number from 0 to 1.");
    }
    const auto latest = rclcpp::QoS(1);
    const auto latched = rclcpp::QoS(1).transient_local();
    const auto topic = [&prefix](const char *name) { return prefix + name; };
    // Not those of the lifecycle: the state is published also while the node is not active.
    measured_ = rclcpp::create_publisher<sensor_msgs::msg::JointState>(node, topic("measured_js"), latest);
    delta_ = rclcpp::create_publisher<std_msgs::msg::Float64MultiArray>(node, topic("hysteresis/delta"), latest);
    operating_state_ = rclcpp::create_publisher<crtk_msgs::msg::OperatingState>(node, topic("operating_state"), latched);
    warning_ = rclcpp::create_publisher<std_msgs::msg::String>(node, topic("warning"), latched);
    diagnostics_ = rclcpp::create_publisher<diagnostic_msgs::msg::DiagnosticArray>(node, "/diagnostics", latest);
    publish_state(control_.status(), clock_->now());
    if (!control_.has_bands()) {
        return;
    }
    worker_ = std::make_shared<DetectionWorker>(
        config_, control_.detection(), [this](const TautscopeReport &report) { on_report(report); },
        [logger = logger_](const std::string &error) { RCLCPP_ERROR(logger, "Image not used: %s", error.c_str()); });

    image_group_ = node.create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
    rclcpp::SubscriptionOptions options;
    options.callback_group = image_group_;
    // A running callback may outlive the subscription.
    images_ = node.create_subscription<sensor_msgs::msg::Image>(
        node.get_parameter("image_topic").as_string(), rclcpp::SensorDataQoS().keep_last(1),
        [worker = std::weak_ptr<DetectionWorker>(worker_), origin = origin_, logger = logger_,
         clock = clock_](sensor_msgs::msg::Image::ConstSharedPtr message) {
            const double captured_at = 1e-9 * static_cast<double>(nanoseconds(message->header.stamp) - origin.nanoseconds());
            auto received = image(message, captured_at);
            if (!received) {
                RCLCPP_ERROR_THROTTLE(logger, *clock, 1000, "Image not used: encoding %s", message->encoding.c_str());
            } else if (const auto target = worker.lock()) {
                target->offer(std::move(*received));
            }
        },
        options);
}

// A callback of the images may still hold the worker.
Session::~Session() {
    if (worker_) {
        worker_->end();
    }
}

double Session::seconds(const builtin_interfaces::msg::Time &stamp) const {
    const std::int64_t now = clock_->now().nanoseconds(), time = nanoseconds(stamp);
    return seconds(time == 0 ? now : std::min(time, now));
}

sensor_msgs::msg::JointState Session::joint_state() const {
    sensor_msgs::msg::JointState message;
    message.header.frame_id = frame_id_;
    message.name = joints_;
    message.position.assign(joints_.size(), 0.0);
    return message;
}

template <class Report> void Session::on_report(const Report &report) {
    sensor_msgs::msg::JointState measured = joint_state();
    std::copy_n(report.state_estimate, measured.position.size(), measured.position.begin());
    // CRTK: a stamp of 0 marks what is not valid.
    if (report.status <= TAUTSCOPE_STATUS_PARTIAL) {
        measured.header.stamp = origin_ + rclcpp::Duration::from_seconds(report.captured_at);
        measured_at_ = now();
    }
    measured_->publish(measured);
    std_msgs::msg::Float64MultiArray delta;
    std::string names;
    std::uint32_t count = 0;
    for (const std::string &dof : control_.dofs()) {
        names += (count > 0 ? "," : "") + dof;
        delta.data.push_back(report.delta_minus[count]);
        delta.data.push_back(report.delta_plus[count++]);
    }
    delta.layout.dim = {dimension(names, count, 2 * count), dimension("minus,plus", 2, 2)};
    delta_->publish(delta);
}

void Session::on_measurement(const sensor_msgs::msg::JointState &message, const std::string &topic, std::uint32_t sensor) {
    publish_reports();
    const Values values = positions(message, control_.dofs());
    const double captured_at = seconds(nanoseconds(message.header.stamp));
    const bool is_known = std::any_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); }) &&
                          std::none_of(values.begin(), values.end(), [](double value) { return std::isinf(value); });
    // NaN was not measured.
    if (!is_known && std::none_of(message.position.begin(), message.position.end(), [](double value) { return std::isnan(value); })) {
        RCLCPP_WARN_THROTTLE(logger_, *clock_, 1000, "%s: got %zu positions of [%s], expected finite ones of [%s]", topic.c_str(),
                             message.position.size(), joined(message.name).c_str(), joined(control_.dofs()).c_str());
    }
    ++counts_.arrived;
    counts_.refused += is_known && control_.detection().measurements.push({values, captured_at, sensor}) ? 0 : 1;
}

/// Those on measurements; the control thread cannot publish.
void Session::publish_reports() {
    for (TautscopeTipReport report; control_.detection().reports.pop(report); ++counts_.used) {
        on_report(report);
    }
}

void Session::report() {
    publish_reports();
    const Status status = control_.status();
    const rclcpp::Time now = clock_->now();
    const bool has_changed = status.state != last_.state;
    if (has_changed || reports_ % reports_per_second == 0) {
        publish_state(status, now);
    }
    const bool has_warning = is_refused(status) || status.latched != 0 || status.flags != 0;
    if (has_warning && (status.flags != last_.flags || status.latched != last_.latched || is_refused(status) != is_refused(last_))) {
        std_msgs::msg::String warning;
        warning.data = description(status);
        warning_->publish(warning);
        RCLCPP_WARN(logger_, "%s", warning.data.c_str());
    }
    if (has_changed || reports_ % reports_per_second == 0) {
        publish_diagnostics(status, now);
    }
    if (seconds(now.nanoseconds()) - measured_at_ > measured_timeout) {
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
    about.hardware_id = frame_id_;
    about.message = status.flags == 0 && !is_refused(status) ? name(status.state) : description(status);
    about.level = is_refused(status) || status.reaction >= TAUTSCOPE_REACTION_HOLD_MOTION ? Level::ERROR
                  : status.flags != 0 || status.latched != 0                               ? Level::WARN
                                                                                          : Level::OK;
    ImageCounts counts = worker_ ? worker_->counts() : counts_;
    counts.refused += control_.detection().refused;
    const std::string what = worker_ ? "images" : "measurements";
    about.values = {
        key_value("operating_state", name(status.state)),
        key_value("reaction", tautscope_reaction_name(status.reaction)),
        key_value("flags", flag_names(status.flags)),
        key_value("latched", flag_names(status.latched)),
        key_value(what + " arrived", std::to_string(counts.arrived)),
        key_value(what + " replaced by newer ones", std::to_string(counts.replaced)),
        key_value(what + " used", std::to_string(counts.used)),
        key_value(what + " refused", std::to_string(counts.refused)),
    };
    diagnostic_msgs::msg::DiagnosticArray message;
    message.header.stamp = now;
    message.status.push_back(about);
    diagnostics_->publish(message);
}

} // namespace tautscope_control
