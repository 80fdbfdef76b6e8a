/* The controller as plugin, with interfaces and a clock of this test: the commands of the loop, bit for bit, without an allocation.

   controller RECORDING TIP        (recordings of examples/cpp/record.py: at 1 kHz, as .../best, and of a robot, as .../tip_best) */

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <controller_interface/chainable_controller_interface.hpp>
#include <crtk_msgs/msg/operating_state.hpp>
#include <crtk_msgs/msg/string_stamped.hpp>
#include <pluginlib/class_loader.hpp>
#include <rcl/time.h>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/joint_state.hpp>
#include <std_msgs/msg/float64_multi_array.hpp>

#include "expect.hpp"
#include "recording.hpp"
#include "tautscope_control/control_loop.hpp"

namespace {
/// Of this thread alone: the middleware has its own.
thread_local bool is_counted = false;
unsigned long allocations = 0;
} // namespace

extern "C" {
void *__libc_malloc(std::size_t size);
void *__libc_calloc(std::size_t number, std::size_t size);
void *__libc_realloc(void *memory, std::size_t size);

void *malloc(std::size_t size) {
    allocations += is_counted;
    return __libc_malloc(size);
}

void *calloc(std::size_t number, std::size_t size) {
    allocations += is_counted;
    return __libc_calloc(number, size);
}

void *realloc(void *memory, std::size_t size) {
    allocations += is_counted;
    return __libc_realloc(memory, size);
}
}

namespace {

using controller_interface::return_type;
using hardware_interface::CommandInterface;
using hardware_interface::LoanedCommandInterface;
using hardware_interface::LoanedStateInterface;
using hardware_interface::StateInterface;
using lifecycle_msgs::msg::State;

using tautscope::Numbers;

const std::vector<std::string> joints_of_article{"insertion", "rotation", "bending"};
constexpr tautscope::Vector start{25e-3, 0.0, 0.9};

/// The encoders of the robot of `record_tip`.
constexpr char encoders[] = "/encoders";

/// The controller, with motors that are where they were last commanded.
class Rig {
public:
    Rig(pluginlib::ClassLoader<controller_interface::ChainableControllerInterface> &loader, const std::string &config,
        std::vector<std::string> names = joints_of_article, Numbers begin = start, unsigned int rate = 1000)
        : command(begin.data(), begin.data() + begin.size()), measured(command), joints(std::move(names)),
          controller_(loader.createSharedInstance("tautscope_control/HysteresisController")) {
        controller_interface::ControllerInterfaceParams parameters;
        parameters.controller_name = "instrument";
        parameters.controller_manager_update_rate = parameters.update_rate = rate;
        parameters.node_options.parameter_overrides(
            {{"config", config}, {"measurement_topics", std::vector<std::string>{encoders}}});
        EXPECT(controller_->init(parameters) == return_type::OK);
        // Simulated time.
        EXPECT(rcl_enable_ros_time_override(clock()) == RCL_RET_OK);
        set_time(0);
        executor_.add_node(controller_->get_node()->get_node_base_interface());
    }

    ~Rig() { controller_->get_node()->shutdown(); }

    void configure() {
        EXPECT(controller_->configure().id() == State::PRIMARY_STATE_INACTIVE);
        references_ = controller_->export_reference_interfaces();
        EXPECT(references_.size() == joints.size());
        for (std::size_t i = 0; i < joints.size(); ++i) {
            EXPECT(references_[i]->get_name() == "instrument/" + joints[i] + "/position");
        }
    }

    void activate(bool is_chained, std::uint8_t expected = State::PRIMARY_STATE_ACTIVE) {
        EXPECT(controller_->set_chained_mode(is_chained));
        std::vector<LoanedCommandInterface> commands;
        std::vector<LoanedStateInterface> states;
        const auto command_names = controller_->command_interface_configuration().names;
        const auto state_names = controller_->state_interface_configuration().names;
        for (std::size_t i = 0; i < joints.size(); ++i) {
            const std::string name = joints[i] + "/position";
            EXPECT(command_names.at(i) == name && state_names.at(i) == name);
            // A loan does not keep its interface.
            const auto lent = std::make_shared<CommandInterface>(joints[i], "position", &command[i]);
            const auto read = std::make_shared<StateInterface>(joints[i], "position", &measured[i]);
            interfaces_.insert(interfaces_.end(), {lent, read});
            commands.emplace_back(lent, nullptr);
            states.emplace_back(read, nullptr);
        }
        controller_->assign_interfaces(std::move(commands), std::move(states));
        EXPECT(controller_->get_node()->activate().id() == expected);
    }

    void deactivate() {
        EXPECT(controller_->get_node()->deactivate().id() == State::PRIMARY_STATE_INACTIVE);
        controller_->release_interfaces();
    }

    void refer(Numbers reference) {
        for (std::size_t i = 0; i < joints.size(); ++i) {
            EXPECT(references_[i]->set_value(reference.data()[i]));
        }
    }

    return_type update(std::int64_t nanoseconds) {
        set_time(nanoseconds);
        is_counted = true;
        const return_type result = controller_->update(rclcpp::Time(nanoseconds), rclcpp::Duration(0, 1000000));
        is_counted = false;
        measured = command;
        return result;
    }

    void spin() { executor_.spin_some(); }

    rclcpp_lifecycle::LifecycleNode &node() { return *controller_->get_node(); }

    /// Nanoseconds since 1970 at the begin of the simulated time.
    static constexpr std::int64_t epoch = 1'700'000'000'000'000'000;

    std::vector<double> command, measured;
    const std::vector<std::string> joints;

private:
    rcl_clock_t *clock() { return controller_->get_node()->get_clock()->get_clock_handle(); }

    void set_time(std::int64_t nanoseconds) { EXPECT(rcl_set_ros_time_override(clock(), epoch + nanoseconds) == RCL_RET_OK); }

    std::shared_ptr<controller_interface::ChainableControllerInterface> controller_;
    std::vector<CommandInterface::SharedPtr> references_;
    std::vector<std::shared_ptr<void>> interfaces_;
    rclcpp::executors::SingleThreadedExecutor executor_;
};

using Loader = pluginlib::ClassLoader<controller_interface::ChainableControllerInterface>;

void chained_references_give_the_commands_of_the_loop(Loader &loader, const std::string &recording) {
    Rig rig(loader, recording + ".toml");
    rig.configure();
    rig.activate(true);
    tautscope_control::ControlLoop expected(tautscope::read_file(recording + ".toml"));
    expected.post(tautscope_control::Request::enable);
    const auto ticks = read_rows<Tick>(recording + ".ticks");
    std::size_t wrong = 0, moved = 0;
    for (std::size_t tick = 0; tick < 13000; ++tick) {
        const auto nanoseconds = static_cast<std::int64_t>(tick) * 1000000;
        rig.refer(ticks[tick].reference);
        const auto before = rig.command;
        EXPECT(rig.update(nanoseconds) == return_type::OK);
        expected.set_reference(ticks[tick].reference, std::nan(""));
        const double now = 1e-9 * static_cast<double>(nanoseconds);
        expected.set_measured(start, now);
        const auto wanted = expected.step(now).command;
        wrong += std::memcmp(wanted.data(), rig.command.data(), wanted.size() * sizeof(double)) != 0;
        moved += rig.command != before;
    }
    std::printf("%zu updates unlike the loop, %zu with motion, %lu allocations\n", wrong, moved, allocations);
    EXPECT(wrong == 0 && moved > 10000 && allocations == 0);

    // A reference that is not a number is none: the command rests, and goes on from there.
    const auto rest = rig.command;
    rig.refer({std::nan(""), 0.0, 0.9});
    EXPECT(rig.update(13000 * 1000000LL) == return_type::OK && rig.command == rest);

    // Deactivated, moved by hand, and activated again: an error, and no command.
    rig.deactivate();
    rig.measured[0] = rig.command[0] + 2e-3;
    rig.activate(true);
    rig.refer(ticks[13000].reference);
    EXPECT(rig.update(13001 * 1000000LL) == return_type::ERROR && rig.command == rest);
    rig.deactivate();
    rig.measured[0] = std::nan("");
    rig.activate(true, State::PRIMARY_STATE_INACTIVE);
    rig.measured = rig.command;
    rig.activate(true);
    EXPECT(rig.update(13002 * 1000000LL) == return_type::OK && rig.command == rest);
}

void a_robot_has_its_degrees_of_freedom_and_finds_their_slack(Loader &loader, const std::string &recording) {
    struct TipTick {
        double time, made_at, reference[2], event, command[2];
    };
    const tautscope::Vector ends{0.6, 8e-3, 0.0};
    Rig rig(loader, recording + ".toml", {"bend", "slide"}, Numbers{0.0, 0.0}, 200);
    rig.configure();
    tautscope_control::ControlLoop expected(tautscope::read_file(recording + ".toml"));
    expected.post(tautscope_control::Request::enable);
    const auto publisher = rclcpp::create_publisher<sensor_msgs::msg::JointState>(rig.node(), encoders, rclcpp::QoS(10));
    std::size_t arrived = 0, sent = 0, wrong = 0, reports = 0;
    std::vector<double> delta;
    sensor_msgs::msg::JointState last;
    const auto arrival = rig.node().create_subscription<sensor_msgs::msg::JointState>(
        encoders, rclcpp::SensorDataQoS().keep_last(10), [&](const sensor_msgs::msg::JointState &) { ++arrived; });
    const auto estimate = rig.node().create_subscription<sensor_msgs::msg::JointState>(
        "/instrument/measured_js", rclcpp::QoS(10), [&](const sensor_msgs::msg::JointState &message) {
            last = message.header.stamp.sec != 0 ? message : last;
        });
    const auto offsets = rig.node().create_subscription<std_msgs::msg::Float64MultiArray>(
        "/instrument/hysteresis/delta", rclcpp::QoS(10),
        [&](const std_msgs::msg::Float64MultiArray &message) {
            delta = message.data;
            ++reports;
        });
    const auto publish = [&](const sensor_msgs::msg::JointState &message) {
        publisher->publish(message);
        for (++sent; arrived < sent;) {
            rig.spin();
        }
    };
    sensor_msgs::msg::JointState before;
    before.name = {"bend", "slide"};
    before.position = {0.5, 5e-3};
    publish(before);
    rig.activate(true);
    double tip[2] = {0.0, 0.0};
    std::int64_t nanoseconds = 0;
    for (const TipTick &now : read_rows<TipTick>(recording + ".ticks")) {
        if (nanoseconds > 0 && nanoseconds % 40000000 == 0) {
            // By name, in any order; one is missing in turns.
            sensor_msgs::msg::JointState message;
            message.header.stamp = rclcpp::Time(Rig::epoch + nanoseconds);
            message.name = {"slide", "bend"};
            message.position = {tip[1], tip[0]};
            tautscope::Values values(Numbers{tip[0], tip[1]});
            if (sent % 3 == 1) {
                message.name.pop_back();
                message.position.pop_back();
                values[0] = std::nan("");
            }
            publish(message);
            EXPECT(expected.detection().measurements.push({values, 1e-9 * static_cast<double>(nanoseconds), 0}));
        }
        rig.refer(now.reference);
        EXPECT(rig.update(nanoseconds) == return_type::OK);
        expected.set_reference(now.reference, std::nan(""));
        expected.set_measured(Numbers{0.0, 0.0}, 1e-9 * static_cast<double>(nanoseconds));
        const auto wanted = expected.step(1e-9 * static_cast<double>(nanoseconds)).command;
        expected.exchange();
        wrong += std::memcmp(wanted.data(), rig.command.data(), sizeof tip) != 0;
        for (std::size_t i = 0; i < 2; ++i) {
            tip[i] = std::min(std::max(tip[i], rig.command[i] - ends[i] / 2), rig.command[i] + ends[i] / 2);
        }
        nanoseconds += 5000000;
    }
    rig.spin();
    rig.spin();
    std::printf("%zu measurements, %zu commands unlike the loop, %lu allocations\n", sent, wrong, allocations);
    EXPECT(wrong == 0 && sent > 900 && reports == sent - 1 && allocations == 0 && delta.size() == 4 && last.name == rig.joints);
    EXPECT(delta.size() == 4 && std::abs(delta[1] - delta[0] - ends[0]) < 0.02 && std::abs(delta[3] - delta[2] - ends[1]) < 0.2e-3);
    EXPECT(last.position.size() == 2 && std::abs(last.position[0] - tip[0]) < 0.1 && std::abs(last.position[1] - tip[1]) < 1e-3);
}

void what_was_requested_before_is_not_executed_when_it_is_activated(Loader &loader, const std::string &recording) {
    for (const char *request : {"disable", "pause"}) {
        Rig rig(loader, recording + ".toml");
        rig.configure();
        std::string state;
        const auto states = rig.node().create_subscription<crtk_msgs::msg::OperatingState>(
            "/instrument/operating_state", rclcpp::QoS(1), [&](const crtk_msgs::msg::OperatingState &message) { state = message.state; });
        crtk_msgs::msg::StringStamped message;
        message.string = request;
        const auto publisher =
            rclcpp::create_publisher<crtk_msgs::msg::StringStamped>(rig.node(), "/instrument/state_command", rclcpp::QoS(10));
        publisher->publish(message);
        for (int spin = 0; spin < 100; ++spin) {
            rig.spin();
        }
        rig.activate(true);
        rig.refer(start);
        EXPECT(rig.update(0) == return_type::OK);
        for (int spin = 0; spin < 1000 && state != "ENABLED"; ++spin) {
            rig.spin();
        }
        EXPECT(state == "ENABLED");
    }
}

void a_position_that_is_not_known_any_more_is_an_error(Loader &loader, const std::string &recording) {
    Rig rig(loader, recording + ".toml");
    rig.configure();
    rig.activate(true);
    return_type result = return_type::OK;
    int tick = 0;
    for (; tick < 1000 && result == return_type::OK; ++tick) {
        rig.refer(start);
        rig.measured[1] = tick < 500 ? rig.measured[1] : std::nan("");
        result = rig.update(tick * 1000000LL);
    }
    EXPECT(result == return_type::ERROR && tick > 500 && tick < 610);
}

void references_of_a_topic_stop_with_their_device(Loader &loader, const std::string &recording) {
    Rig rig(loader, recording + ".toml");
    rig.configure();
    rig.activate(false);
    const auto publisher =
        rclcpp::create_publisher<sensor_msgs::msg::JointState>(rig.node(), "/instrument/servo_jp", rclcpp::QoS(1));
    sensor_msgs::msg::JointState message;
    message.name = rig.joints;
    message.position = {start.begin(), start.end()};
    std::int64_t now = 0;
    const auto run = [&](int ticks, double speed) {
        std::int64_t last_motion = 0;
        for (int tick = 0; tick < ticks; ++tick, now += 1000000) {
            if (speed != 0.0) {
                message.position[0] += 1e-3 * speed;
                publisher->publish(message);
                // Delivered within the process, by its time of arrival.
                rig.spin();
            }
            const auto before = rig.command;
            EXPECT(rig.update(now) == return_type::OK);
            last_motion = rig.command != before ? now : last_motion;
        }
        return last_motion;
    };
    const std::int64_t moving = run(500, 0.01);
    EXPECT(moving > now - 50000000);
    const std::int64_t silent_since = now;
    EXPECT(run(1000, 0.0) <= silent_since + 100000000);
    // It returns: held until the operator resumes.
    EXPECT(run(200, 0.01) == 0);
    std::printf("%lu allocations\n", allocations);
    EXPECT(allocations == 0);
}

void wrong_parameters_are_refused(Loader &loader, const std::string &recording, const std::string &tip) {
    const std::vector<std::string> two{"bend", "bend"};
    // The last one has no topics.
    const std::initializer_list<rclcpp::Parameter> wrongs{{"config", "missing.toml"}, {"compensation", 1.5}, {"update_rate", 200},
                                                          {"joints", two}, {"config", tip + ".toml"}};
    for (const rclcpp::Parameter &wrong : wrongs) {
        const auto controller = loader.createSharedInstance("tautscope_control/HysteresisController");
        controller_interface::ControllerInterfaceParams parameters;
        parameters.controller_name = "instrument";
        parameters.controller_manager_update_rate = parameters.update_rate = &wrong == wrongs.end() - 1 ? 200 : 1000;
        std::vector<rclcpp::Parameter> overrides{wrong};
        if (wrong.get_name() != "config") {
            overrides.emplace_back("config", recording + ".toml");
        }
        parameters.node_options.parameter_overrides(overrides);
        EXPECT(controller->init(parameters) == return_type::OK);
        EXPECT(controller->configure().id() == State::PRIMARY_STATE_UNCONFIGURED);
        controller->get_node()->shutdown();
    }
}

} // namespace

int main(int count, char **arguments) {
    rclcpp::init(0, nullptr);
    {
        const std::string recording = count == 3 ? arguments[1] : "best", tip = count == 3 ? arguments[2] : "tip_best";
        Loader loader("controller_interface", "controller_interface::ChainableControllerInterface");
        chained_references_give_the_commands_of_the_loop(loader, recording);
        what_was_requested_before_is_not_executed_when_it_is_activated(loader, recording);
        a_position_that_is_not_known_any_more_is_an_error(loader, recording);
        references_of_a_topic_stop_with_their_device(loader, recording);
        a_robot_has_its_degrees_of_freedom_and_finds_their_slack(loader, tip);
        wrong_parameters_are_refused(loader, recording, tip);
    }
    rclcpp::shutdown();
    std::printf("%d failures\n", failures);
    return failures > 0;
}
