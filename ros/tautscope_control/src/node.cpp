/* Lifecycle node: CRTK topics in and out, and the control loop in between. */

#include <chrono>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include <rclcpp/rclcpp.hpp>
#include <rclcpp_lifecycle/lifecycle_node.hpp>

#include "tautscope_control/messages.hpp"
#include "tautscope_control/session.hpp"

namespace tautscope_control {

using sensor_msgs::msg::JointState;
using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

/// Node of the instrument. Everything but images runs in its default callback group, one at a time.
class InstrumentNode : public rclcpp_lifecycle::LifecycleNode {
public:
    InstrumentNode() : LifecycleNode("tautscope") { Session::declare_parameters(*this); }

    ~InstrumentNode() override { stop(); }

    CallbackReturn on_configure(const rclcpp_lifecycle::State &) override {
        try {
            session_ = Session::create(*this, "");
        } catch (const std::exception &error) {
            RCLCPP_ERROR(get_logger(), "%s", error.what());
            session_.reset();
            return CallbackReturn::FAILURE;
        }
        const auto latest = rclcpp::QoS(1);
        setpoint_ = rclcpp::create_publisher<JointState>(*this, "setpoint_js", latest);
        actuators_ = rclcpp::create_publisher<JointState>(*this, "actuators/setpoint_js", latest);
        actuators_command_ =
            rclcpp::create_publisher<crtk_msgs::msg::StringStamped>(*this, "actuators/state_command", rclcpp::QoS(10));
        setpoint_message_ = command_message_ = session_->joint_state();
        servo_ = create_subscription<JointState>("servo_jp", latest, [this](const JointState &message) {
            if (!session_->control().set_reference(positions(message, session_->joints()),
                                                   session_->seconds(message.header.stamp))) {
                RCLCPP_WARN_THROTTLE(get_logger(), *get_clock(), 1000, "servo_jp: joints are missing");
            }
        });
        actuators_measured_ =
            create_subscription<JointState>("actuators/measured_js", latest, [this](const JointState &message) {
                // CRTK: a stamp of 0 marks what is not valid. Others count by their arrival.
                if (nanoseconds(message.header.stamp) != 0 &&
                    !session_->control().set_measured(positions(message, session_->joints()), session_->now())) {
                    RCLCPP_WARN_THROTTLE(get_logger(), *get_clock(), 1000, "actuators/measured_js: joints are missing");
                }
            });
        actuators_state_ = create_subscription<crtk_msgs::msg::OperatingState>(
            "actuators/operating_state", rclcpp::QoS(1), [this](const crtk_msgs::msg::OperatingState &message) {
                if (message.state == name(OperatingState::fault)) {
                    session_->control().post(Request::drive_fault);
                }
            });
        parameters_ = add_on_set_parameters_callback(
            [this](const std::vector<rclcpp::Parameter> &parameters) { return on_parameters(parameters); });
        return CallbackReturn::SUCCESS;
    }

    CallbackReturn on_activate(const rclcpp_lifecycle::State &) override {
        last_ = OperatingState::disabled;
        // What was requested before is not executed now.
        session_->control().post(Request::disable);
        session_->control().step(session_->now());
        // Nor is what was measured before used.
        session_->control().exchange();
        const auto period = rclcpp::Duration::from_seconds(session_->control().period());
        tick_ = rclcpp::create_timer(this, get_clock(), period, [this] { tick(); });
        report_ = rclcpp::create_timer(this, get_clock(), rclcpp::Duration::from_seconds(0.1), [this] { report(); });
        return CallbackReturn::SUCCESS;
    }

    CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override {
        stop();
        return CallbackReturn::SUCCESS;
    }

    CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) override { return release(); }

    CallbackReturn on_shutdown(const rclcpp_lifecycle::State &) override { return release(); }

    CallbackReturn on_error(const rclcpp_lifecycle::State &) override { return release(); }

private:
    void tick() {
        const Tick result = session_->control().step(session_->now());
        if (result.is_sent) {
            setpoint_message_.header.stamp = command_message_.header.stamp = get_clock()->now();
            set_positions(command_message_, result.command);
            set_positions(setpoint_message_, session_->control().reference());
            actuators_->publish(command_message_);
            setpoint_->publish(setpoint_message_);
        }
        if (result.state == OperatingState::fault && last_ != OperatingState::fault) {
            stop_drives();
        }
        last_ = result.state;
        session_->control().exchange();
    }

    void report() {
        // A message may be lost, and a drive may begin to listen later.
        if (last_ == OperatingState::fault) {
            stop_drives();
        }
        session_->report();
    }

    /// Quick stop; or disable, where the loop has to be created anew.
    void stop_drives() {
        crtk_msgs::msg::StringStamped command;
        command.header.stamp = get_clock()->now();
        command.string = session_->control().status().reaction == TAUTSCOPE_REACTION_DISABLE ? "disable" : "pause";
        actuators_command_->publish(command);
    }

    void stop() {
        tick_.reset();
        report_.reset();
        if (session_ && last_ != OperatingState::disabled) {
            stop_drives();
            session_->control().post(Request::disable);
            session_->control().step(session_->now());
            session_->report();
            last_ = OperatingState::disabled;
        }
    }

    CallbackReturn release() {
        stop();
        parameters_.reset();
        servo_.reset();
        actuators_measured_.reset();
        actuators_state_.reset();
        session_.reset();
        return CallbackReturn::SUCCESS;
    }

    rcl_interfaces::msg::SetParametersResult on_parameters(const std::vector<rclcpp::Parameter> &parameters) {
        rcl_interfaces::msg::SetParametersResult result;
        result.successful = true;
        for (const rclcpp::Parameter &parameter : parameters) {
            if (parameter.get_name() == "compensation" && session_ &&
                !session_->control().set_compensation(parameter.as_double())) {
                result.successful = false;
                result.reason = "Parameter compensation: expected a number from 0 to 1.";
            }
        }
        return result;
    }

    std::shared_ptr<Session> session_;
    OperatingState last_ = OperatingState::disabled;
    JointState setpoint_message_, command_message_;
    rclcpp::Publisher<JointState>::SharedPtr setpoint_, actuators_;
    rclcpp::Publisher<crtk_msgs::msg::StringStamped>::SharedPtr actuators_command_;
    rclcpp::Subscription<JointState>::SharedPtr servo_, actuators_measured_;
    rclcpp::Subscription<crtk_msgs::msg::OperatingState>::SharedPtr actuators_state_;
    rclcpp::TimerBase::SharedPtr tick_, report_;
    rclcpp::node_interfaces::OnSetParametersCallbackHandle::SharedPtr parameters_;
};

} // namespace tautscope_control

int main(int count, char **arguments) {
    rclcpp::init(count, arguments);
    auto node = std::make_shared<tautscope_control::InstrumentNode>();
    // One thread for the ticks, and one that receives images.
    rclcpp::executors::MultiThreadedExecutor executor(rclcpp::ExecutorOptions(), 2);
    executor.add_node(node->get_node_base_interface());
    // After the shutdown nothing can be published: it waits until the node has stopped the drives.
    std::promise<void> stopped;
    node->get_node_base_interface()->get_context()->add_pre_shutdown_callback([&executor, done = stopped.get_future().share()] {
        executor.cancel();
        done.wait_for(std::chrono::seconds(1));
    });
    executor.spin();
    node.reset();
    stopped.set_value();
    rclcpp::shutdown();
}
