/* The node with test doubles of ROS: requests from before it was active, and stamps before 1970.

   node BEST TIP        (configurations of examples/cpp/record.py, of the article and of a robot) */

// Only `main` needs no `return`; under another name it is never called.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wreturn-type"
#define main main_of_the_node
#include "../src/node.cpp"
#undef main
#pragma GCC diagnostic pop

#include <cmath>
#include <cstdio>

#include "expect.hpp"

using namespace tautscope_control;

namespace {

/// The node, its drives and its operator.
struct Laboratory {
    explicit Laboratory(const std::string &config) {
        node.declare_parameter("config", config);
        node.declare_parameter("measurement_topics", std::vector<std::string>{"/encoders"});
        node.get_clock()->get_clock_handle()->now = 1'700'000'000'000'000'000;
        commands = node.create_subscription<JointState>("actuators/setpoint_js", rclcpp::QoS(1),
                                                        [this](const JointState &) { ++sent; });
        states = node.create_subscription<crtk_msgs::msg::OperatingState>(
            "operating_state", rclcpp::QoS(1), [this](const crtk_msgs::msg::OperatingState &message) { state = message.state; });
        EXPECT(node.configure().id() == lifecycle_msgs::msg::State::PRIMARY_STATE_INACTIVE);
    }

    ~Laboratory() { node.shutdown(); }

    /// Delivers a message; timers run alike.
    template <class Message> void publish(const std::string &topic, const Message &message) {
        rclcpp::create_publisher<Message>(node, topic, rclcpp::QoS(1))->publish(message);
        executor.spin_some();
        node.get_clock()->get_clock_handle()->now += 5'000'000;
    }

    void request(const std::string &text) {
        crtk_msgs::msg::StringStamped message;
        message.string = text;
        publish("state_command", message);
    }

    /// Joints at 0 by their order, with the stamp of now or another.
    JointState positions(std::size_t count, std::int32_t seconds = 0) {
        JointState message;
        message.position.assign(count, 0.0);
        message.header.stamp = node.get_clock()->now();
        message.header.stamp.sec = seconds == 0 ? message.header.stamp.sec : seconds;
        return message;
    }

    InstrumentNode node;
    rclcpp::executors::SingleThreadedExecutor executor;
    rclcpp::Subscription<JointState>::SharedPtr commands;
    rclcpp::Subscription<crtk_msgs::msg::OperatingState>::SharedPtr states;
    int sent = 0;
    std::string state;
};

void what_was_requested_before_is_not_executed_when_it_is_activated(const std::string &config) {
    Laboratory laboratory(config);
    laboratory.request("enable");
    laboratory.node.activate();
    laboratory.publish("actuators/measured_js", laboratory.positions(3));
    for (int tick = 0; tick < 20; ++tick) {
        laboratory.publish("servo_jp", laboratory.positions(3));
    }
    EXPECT(laboratory.sent == 0 && laboratory.state == "DISABLED");
    laboratory.publish("actuators/measured_js", laboratory.positions(3));
    laboratory.request("enable");
    laboratory.publish("servo_jp", laboratory.positions(3));
    laboratory.publish("servo_jp", laboratory.positions(3));
    EXPECT(laboratory.sent > 0);
}

void silent_drives_stop_the_node(const std::string &config) {
    Laboratory laboratory(config);
    laboratory.node.activate();
    laboratory.publish("actuators/measured_js", laboratory.positions(3));
    laboratory.request("enable");
    for (int tick = 0; tick < 10; ++tick) {
        laboratory.publish("servo_jp", laboratory.positions(3));
    }
    EXPECT(laboratory.state == "ENABLED");
    for (int tick = 0; tick < 20; ++tick) {
        laboratory.publish("servo_jp", laboratory.positions(3));
    }
    EXPECT(laboratory.state == "FAULT");
}

void what_cannot_be_used_is_named(const std::string &config) {
    Laboratory laboratory(config);
    laboratory.node.activate();
    JointState message = laboratory.positions(2);
    const auto log_of = [&](const std::string &topic) {
        rclcpp::last_log.clear();
        laboratory.publish(topic, message);
        return rclcpp::last_log;
    };
    EXPECT(log_of("/encoders").empty() && log_of("actuators/measured_js").empty());
    message.position = {std::nan(""), std::nan("")}; // not measured
    EXPECT(log_of("/encoders").empty());
    message.position = {INFINITY, 0.0};
    message.name = {"bend", "slide"};
    EXPECT(log_of("/encoders") == "/encoders: got 2 positions of [bend, slide], expected finite ones of [bend, slide]");
    message.position = {0.0, 0.0};
    message.name = {"left", "right"};
    EXPECT(log_of("/encoders") == "/encoders: got 2 positions of [left, right], expected finite ones of [bend, slide]");
    EXPECT(log_of("actuators/measured_js") == "actuators/measured_js: joints are missing");
}

void a_stamp_before_1970_ends_nothing(const std::string &config, std::size_t count) {
    Laboratory laboratory(config);
    laboratory.node.activate();
    for (const std::int32_t seconds : {-1, std::numeric_limits<std::int32_t>::min()}) {
        laboratory.publish("actuators/measured_js", laboratory.positions(count, seconds));
        laboratory.request("enable");
        laboratory.publish("servo_jp", laboratory.positions(count));
        laboratory.publish("servo_jp", laboratory.positions(count));
        EXPECT(laboratory.state == "ENABLED");
        laboratory.publish("/encoders", laboratory.positions(count, seconds));
        sensor_msgs::msg::Image image;
        image.header = laboratory.positions(count, seconds).header;
        laboratory.publish("/endoscope/image_raw", image);
        // It is an old reference, which stops the motion.
        laboratory.request("resume");
        laboratory.publish("servo_jp", laboratory.positions(count, seconds));
        laboratory.publish("servo_jp", laboratory.positions(count, seconds));
        EXPECT(laboratory.state == "PAUSED");
    }
}

} // namespace

int main(int count, char **arguments) try {
    const std::string best = count == 3 ? arguments[1] : "best.toml", tip = count == 3 ? arguments[2] : "tip_best.toml";
    what_was_requested_before_is_not_executed_when_it_is_activated(best);
    silent_drives_stop_the_node(best);
    what_cannot_be_used_is_named(tip);
    a_stamp_before_1970_ends_nothing(best, 3);
    a_stamp_before_1970_ends_nothing(tip, 2);
    std::printf("%d failures\n", failures);
    return failures > 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
