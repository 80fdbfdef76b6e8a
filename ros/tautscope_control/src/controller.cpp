/* ros2_control controller: references of the joints in, their position commands out. */

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <hardware_interface/types/hardware_interface_type_values.hpp>
#include <pluginlib/class_list_macros.hpp>
#include <realtime_tools/realtime_buffer.hpp>

#include "tautscope_control/chainable_controller.hpp"
#include "tautscope_control/messages.hpp"
#include "tautscope_control/session.hpp"

namespace tautscope_control {

using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;
using controller_interface::return_type;

/// Chainable controller. In chained mode the references come from another controller, else from `~/servo_jp`.
///
/// `update` neither allocates nor waits. It returns an error, so that the controller manager deactivates the controller, when the
/// drives have to stop.
class HysteresisController : public ChainableController {
public:
    CallbackReturn on_init() override {
        try {
            Session::declare_parameters(*get_node());
        } catch (const std::exception &error) {
            RCLCPP_ERROR(get_node()->get_logger(), "%s", error.what());
            return CallbackReturn::ERROR;
        }
        return CallbackReturn::SUCCESS;
    }

    InterfaceConfiguration command_interface_configuration() const override { return positions_of_joints(); }

    InterfaceConfiguration state_interface_configuration() const override { return positions_of_joints(); }

    CallbackReturn on_configure(const rclcpp_lifecycle::State &) override {
        const auto node = get_node();
        try {
            session_ = Session::create(*node, "~/");
            const double rate = 1.0 / session_->control().period();
            if (!is_updated_at(rate)) {
                throw std::invalid_argument("Parameter update_rate: expected " + std::to_string(rate) +
                                            " Hz, as control.period of the configuration, got " +
                                            std::to_string(get_update_rate()));
            }
        } catch (const std::exception &error) {
            RCLCPP_ERROR(node->get_logger(), "%s", error.what());
            session_.reset();
            return CallbackReturn::FAILURE;
        }
        servo_ = node->create_subscription<sensor_msgs::msg::JointState>(
            "~/servo_jp", rclcpp::QoS(1), [this, session = session_](const sensor_msgs::msg::JointState &message) {
                const Values position = positions(message, session->joints());
                if (std::any_of(position.begin(), position.end(), [](double value) { return std::isnan(value); })) {
                    RCLCPP_WARN_THROTTLE(get_node()->get_logger(), *get_node()->get_clock(), 1000,
                                         "servo_jp: joints are missing");
                } else {
                    received_.writeFromNonRT({position, session->seconds(message.header.stamp), ++messages_});
                }
            });
        report_ = node->create_wall_timer(std::chrono::milliseconds(100), [session = session_] { session->report(); });
        return CallbackReturn::SUCCESS;
    }

    CallbackReturn on_activate(const rclcpp_lifecycle::State &) override {
        std::fill(reference_interfaces_.begin(), reference_interfaces_.end(), unknown);
        if (!measure()) {
            RCLCPP_ERROR(get_node()->get_logger(), "It is not known where the drives are: a state interface has no number");
            return CallbackReturn::FAILURE;
        }
        used_message_ = received_.readFromRT()->number;
        // What was requested and measured before is dropped.
        session_->control().post(Request::disable);
        session_->control().step(session_->now());
        session_->control().exchange();
        session_->control().post(Request::enable);
        return CallbackReturn::SUCCESS;
    }

    CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override {
        session_->control().post(Request::disable);
        session_->control().step(session_->now());
        return CallbackReturn::SUCCESS;
    }

    CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) override { return release(); }

    CallbackReturn on_shutdown(const rclcpp_lifecycle::State &) override { return release(); }

    CallbackReturn on_error(const rclcpp_lifecycle::State &) override { return release(); }

protected:
    std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() override {
        const auto &names = session_->joints();
        reference_interfaces_.assign(names.size(), unknown);
        std::vector<hardware_interface::CommandInterface> interfaces;
        interfaces.reserve(names.size());
        for (std::size_t i = 0; i < names.size(); ++i) {
            interfaces.emplace_back(get_node()->get_name(), names[i] + "/" + hardware_interface::HW_IF_POSITION,
                                    &reference_interfaces_[i]);
        }
        return interfaces;
    }

    return_type read_references() override {
        const Received *received = received_.readFromRT();
        const bool is_new = received->number != used_message_;
        used_message_ = received->number;
        for (std::size_t i = 0; i < reference_interfaces_.size(); ++i) {
            // Only a new message is a new reference.
            reference_interfaces_[i] = is_new ? received->position[i] : unknown;
        }
        made_at_ = received->made_at;
        return return_type::OK;
    }

    return_type update_and_write_commands(const rclcpp::Time &, const rclcpp::Duration &) override {
        ControlLoop &control = session_->control();
        measure();
        control.set_reference(reference_interfaces_, is_in_chained_mode() ? unknown : made_at_);
        // Of the clock of the images; the time given is that of the controller manager.
        const Tick tick = control.step(session_->now());
        for (std::size_t i = 0; i < tick.command.size() && tick.is_sent; ++i) {
            write(command_interfaces_[i], tick.command[i]);
        }
        control.exchange();
        return tick.state == OperatingState::fault ? return_type::ERROR : return_type::OK;
    }

private:
    static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

    struct Received {
        Values position;
        double made_at = unknown;
        std::uint64_t number = 0;
    };

    /// Hands the positions of the drives to the loop. Returns false if one is not known.
    bool measure() noexcept {
        Values measured(state_interfaces_.size());
        for (std::size_t i = 0; i < measured.size(); ++i) {
            measured[i] = read(state_interfaces_[i]).value_or(unknown);
        }
        return session_->control().set_measured(measured, session_->now());
    }

    InterfaceConfiguration positions_of_joints() const {
        InterfaceConfiguration configuration{controller_interface::interface_configuration_type::INDIVIDUAL, {}};
        for (const std::string &joint : session_ ? session_->joints() : std::vector<std::string>{}) {
            configuration.names.push_back(joint + "/" + hardware_interface::HW_IF_POSITION);
        }
        return configuration;
    }

    CallbackReturn release() {
        report_.reset();
        servo_.reset();
        session_.reset();
        return CallbackReturn::SUCCESS;
    }

    std::shared_ptr<Session> session_;
    realtime_tools::RealtimeBuffer<Received> received_;
    std::uint64_t messages_ = 0, used_message_ = 0;
    double made_at_ = unknown;
    rclcpp::Subscription<sensor_msgs::msg::JointState>::SharedPtr servo_;
    rclcpp::TimerBase::SharedPtr report_;
};

} // namespace tautscope_control

PLUGINLIB_EXPORT_CLASS(tautscope_control::HysteresisController, controller_interface::ChainableControllerInterface)
