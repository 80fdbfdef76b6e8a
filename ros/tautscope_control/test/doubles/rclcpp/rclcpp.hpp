/* Test double of rclcpp: nodes of one process and one thread, topics by their full names, and simulated time. */

#ifndef DOUBLES_RCLCPP_HPP
#define DOUBLES_RCLCPP_HPP

#include <algorithm>
#include <any>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <typeinfo>
#include <utility>
#include <variant>
#include <vector>

#include "messages.hpp"

struct rcl_clock_t {
    std::int64_t now = 0;
};
enum rcl_clock_type_t { RCL_ROS_TIME };

namespace rclcpp {

class Duration {
public:
    Duration(std::int32_t seconds, std::uint32_t nanoseconds) : nanoseconds_(seconds * 1'000'000'000LL + nanoseconds) {}
    explicit Duration(std::chrono::nanoseconds time) : nanoseconds_(time.count()) {}
    static Duration from_seconds(double seconds) {
        return Duration(std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds)));
    }
    std::int64_t nanoseconds() const { return nanoseconds_; }

private:
    std::int64_t nanoseconds_;
};

class Time {
public:
    explicit Time(std::int64_t nanoseconds = 0, rcl_clock_type_t = RCL_ROS_TIME) : nanoseconds_(nanoseconds) {}
    Time(const builtin_interfaces::msg::Time &stamp, rcl_clock_type_t = RCL_ROS_TIME)
        : nanoseconds_(stamp.sec * 1'000'000'000LL + stamp.nanosec) {
        if (stamp.sec < 0) {
            throw std::runtime_error("cannot store a negative time point in rclcpp::Time");
        }
    }
    operator builtin_interfaces::msg::Time() const {
        return {static_cast<std::int32_t>(nanoseconds_ / 1'000'000'000), static_cast<std::uint32_t>(nanoseconds_ % 1'000'000'000)};
    }
    std::int64_t nanoseconds() const { return nanoseconds_; }
    rcl_clock_type_t get_clock_type() const { return RCL_ROS_TIME; }
    Duration operator-(const Time &other) const { return Duration(std::chrono::nanoseconds(nanoseconds_ - other.nanoseconds_)); }
    Time operator+(const Duration &duration) const { return Time(nanoseconds_ + duration.nanoseconds()); }
    bool operator<(const Time &other) const { return nanoseconds_ < other.nanoseconds_; }

private:
    std::int64_t nanoseconds_;
};

class Clock {
public:
    using SharedPtr = std::shared_ptr<Clock>;
    Time now() const { return Time(handle_.now); }
    rcl_clock_t *get_clock_handle() { return &handle_; }

private:
    rcl_clock_t handle_;
};

struct Logger {
    std::string name;
};

/// The last text of a log, for tests.
inline std::string last_log;

template <class... Values> void log(const char *format, Values... values) {
    char text[1024];
    std::snprintf(text, sizeof text, format, values...);
    last_log = text;
}
inline void log(const char *text) { last_log = text; }

#define RCLCPP_ERROR(logger, ...) (static_cast<void>(logger), rclcpp::log(__VA_ARGS__))
#define RCLCPP_WARN RCLCPP_ERROR
#define RCLCPP_ERROR_THROTTLE(logger, clock, period, ...)                                                              \
    (static_cast<void>(logger), static_cast<void>((clock).now()), rclcpp::log(__VA_ARGS__))
#define RCLCPP_WARN_THROTTLE RCLCPP_ERROR_THROTTLE

struct QoS {
    explicit QoS(std::size_t depth) : depth(depth) {}
    QoS &transient_local() { return *this; }
    QoS &keep_last(std::size_t new_depth) {
        depth = new_depth;
        return *this;
    }
    std::size_t depth;
};
struct SensorDataQoS : QoS {
    SensorDataQoS() : QoS(5) {}
};

enum class CallbackGroupType { MutuallyExclusive };
struct CallbackGroup {
    using SharedPtr = std::shared_ptr<CallbackGroup>;
};
struct SubscriptionOptions {
    CallbackGroup::SharedPtr callback_group;
};

/// What waits for the executor.
inline std::vector<std::function<void()>> &waiting() {
    static std::vector<std::function<void()>> callbacks;
    return callbacks;
}

struct SubscriptionBase {
    std::function<void(const std::any &)> receive;
};
inline std::multimap<std::string, std::weak_ptr<SubscriptionBase>> &topics() {
    static std::multimap<std::string, std::weak_ptr<SubscriptionBase>> all;
    return all;
}

template <class Message> struct Subscription : SubscriptionBase {
    using SharedPtr = std::shared_ptr<Subscription>;
};

template <class Message> class Publisher {
public:
    using SharedPtr = std::shared_ptr<Publisher>;
    explicit Publisher(std::string topic) : topic_(std::move(topic)) {}
    void publish(const Message &message) {
        const auto [first, last] = topics().equal_range(topic_);
        for (auto each = first; each != last; ++each) {
            waiting().push_back([weak = each->second, message] {
                if (const auto subscription = weak.lock()) {
                    subscription->receive(message);
                }
            });
        }
    }

private:
    std::string topic_;
};

struct TimerBase {
    using SharedPtr = std::shared_ptr<TimerBase>;
    std::function<void()> callback;
};
/// All timers, called by every `spin_some`.
inline std::vector<std::weak_ptr<TimerBase>> &timers() {
    static std::vector<std::weak_ptr<TimerBase>> all;
    return all;
}

using ParameterValue = std::variant<double, std::int64_t, std::string, std::vector<std::string>>;
class Parameter {
public:
    template <class Value> Parameter(std::string name, const Value &value) : name_(std::move(name)), value_(converted(value)) {}
    const std::string &get_name() const { return name_; }
    const ParameterValue &value() const { return value_; }
    double as_double() const { return std::get<double>(value_); }
    std::string as_string() const { return std::get<std::string>(value_); }
    std::vector<std::string> as_string_array() const { return std::get<std::vector<std::string>>(value_); }

private:
    static ParameterValue converted(int value) { return std::int64_t{value}; }
    static ParameterValue converted(const char *value) { return std::string(value); }
    template <class Value> static ParameterValue converted(const Value &value) { return value; }
    std::string name_;
    ParameterValue value_;
};

class NodeOptions {
public:
    NodeOptions &parameter_overrides(std::vector<Parameter> overrides) {
        overrides_ = std::move(overrides);
        return *this;
    }
    const std::vector<Parameter> &parameter_overrides() const { return overrides_; }

private:
    std::vector<Parameter> overrides_;
};

struct Context {
    void add_pre_shutdown_callback(std::function<void()>) {}
};

namespace node_interfaces {
struct OnSetParametersCallbackHandle {
    using SharedPtr = std::shared_ptr<OnSetParametersCallbackHandle>;
};
struct NodeBaseInterface {
    using SharedPtr = std::shared_ptr<NodeBaseInterface>;
    std::shared_ptr<Context> get_context() { return std::make_shared<Context>(); }
};
} // namespace node_interfaces

class Node {
public:
    explicit Node(std::string name, const NodeOptions &options = {}) : name_(std::move(name)), options_(options) {}
    virtual ~Node() = default;
    const char *get_name() const { return name_.c_str(); }
    std::string get_fully_qualified_name() const { return "/" + name_; }
    Logger get_logger() const { return {name_}; }
    Clock::SharedPtr get_clock() const { return clock_; }
    node_interfaces::NodeBaseInterface::SharedPtr get_node_base_interface() const { return base_; }
    CallbackGroup::SharedPtr create_callback_group(CallbackGroupType) { return std::make_shared<CallbackGroup>(); }

    template <class Value> void declare_parameter(const std::string &name, const Value &value) {
        Parameter declared(name, value);
        for (const Parameter &own : options_.parameter_overrides()) {
            if (own.get_name() == name) {
                declared = own;
            }
        }
        parameters_.insert_or_assign(name, declared);
    }
    bool has_parameter(const std::string &name) const { return parameters_.count(name) > 0; }
    Parameter get_parameter(const std::string &name) const { return parameters_.at(name); }
    template <class Callback> auto add_on_set_parameters_callback(Callback) {
        return std::make_shared<node_interfaces::OnSetParametersCallbackHandle>();
    }

    std::string topic(const std::string &given) const {
        return given.rfind("~/", 0) == 0 ? "/" + name_ + given.substr(1) : given.rfind("/", 0) == 0 ? given : "/" + given;
    }
    template <class Message, class Callback>
    typename Subscription<Message>::SharedPtr create_subscription(const std::string &name, const QoS &, Callback callback,
                                                                  const SubscriptionOptions & = {}) {
        auto made = std::make_shared<Subscription<Message>>();
        made->receive = [callback = std::move(callback)](const std::any &message) mutable {
            const auto received = std::make_shared<const Message>(std::any_cast<const Message &>(message));
            if constexpr (std::is_invocable_v<Callback &, std::shared_ptr<const Message>>) {
                callback(received);
            } else {
                callback(*received);
            }
        };
        topics().emplace(topic(name), made);
        return made;
    }
    template <class Period, class Callback> TimerBase::SharedPtr create_wall_timer(Period, Callback callback) {
        auto made = std::make_shared<TimerBase>();
        made->callback = std::move(callback);
        timers().push_back(made);
        return made;
    }

private:
    std::string name_;
    NodeOptions options_;
    Clock::SharedPtr clock_ = std::make_shared<Clock>();
    node_interfaces::NodeBaseInterface::SharedPtr base_ = std::make_shared<node_interfaces::NodeBaseInterface>();
    std::map<std::string, Parameter> parameters_;
};

template <class Message> typename Publisher<Message>::SharedPtr create_publisher(Node &node, const std::string &name, const QoS &) {
    return std::make_shared<Publisher<Message>>(node.topic(name));
}
template <class NodeT, class Callback>
TimerBase::SharedPtr create_timer(NodeT *node, Clock::SharedPtr, Duration, Callback callback) {
    return node->create_wall_timer(0, std::move(callback));
}

struct ExecutorOptions {};
namespace executors {
struct SingleThreadedExecutor {
    void add_node(const node_interfaces::NodeBaseInterface::SharedPtr &) {}
    void spin_some() {
        const auto callbacks = std::exchange(waiting(), {});
        for (const auto &callback : callbacks) {
            callback();
        }
        for (const auto &timer : std::vector(timers())) {
            if (const auto alive = timer.lock()) {
                alive->callback();
            }
        }
    }
    void spin() {}
    void cancel() {}
};
struct MultiThreadedExecutor : SingleThreadedExecutor {
    MultiThreadedExecutor(const ExecutorOptions &, std::size_t) {}
};
} // namespace executors

inline void init(int, char **) {}
inline void shutdown() {}

} // namespace rclcpp

#endif
