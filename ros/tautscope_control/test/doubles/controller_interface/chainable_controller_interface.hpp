/* Test double of ros2_control of Jazzy: interfaces that point to numbers, and what its controller manager does. */

#ifndef DOUBLES_CHAINABLE_CONTROLLER_INTERFACE_HPP
#define DOUBLES_CHAINABLE_CONTROLLER_INTERFACE_HPP

#include <optional>

#include <rclcpp_lifecycle/lifecycle_node.hpp>

namespace hardware_interface {

class StateInterface {
public:
    using SharedPtr = std::shared_ptr<StateInterface>;
    StateInterface(const std::string &prefix, const std::string &name, double *value) : name_(prefix + "/" + name), value_(value) {}
    const std::string &get_name() const { return name_; }
    std::optional<double> get_optional() const { return *value_; }
    bool set_value(double value) {
        *value_ = value;
        return true;
    }

private:
    std::string name_;
    double *value_;
};

class CommandInterface : public StateInterface {
public:
    using SharedPtr = std::shared_ptr<CommandInterface>;
    using StateInterface::StateInterface;
};

struct LoanedCommandInterface {
    LoanedCommandInterface(CommandInterface::SharedPtr lent, std::nullptr_t) : interface(lent.get()) {}
    bool set_value(double value) { return interface->set_value(value); }
    CommandInterface *interface;
};

struct LoanedStateInterface {
    LoanedStateInterface(StateInterface::SharedPtr lent, std::nullptr_t) : interface(lent.get()) {}
    std::optional<double> get_optional() const { return interface->get_optional(); }
    StateInterface *interface;
};

} // namespace hardware_interface

namespace controller_interface {

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;
enum class return_type : std::uint8_t { OK, ERROR };
enum class interface_configuration_type : std::uint8_t { ALL, INDIVIDUAL, NONE };
struct InterfaceConfiguration {
    interface_configuration_type type;
    std::vector<std::string> names;
};

struct ControllerInterfaceParams {
    std::string controller_name;
    unsigned int update_rate = 0, controller_manager_update_rate = 0;
    rclcpp::NodeOptions node_options;
};

class ChainableControllerInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface {
public:
    virtual CallbackReturn on_init() = 0;
    virtual InterfaceConfiguration command_interface_configuration() const = 0;
    virtual InterfaceConfiguration state_interface_configuration() const = 0;

    return_type init(const ControllerInterfaceParams &parameters) {
        node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>(parameters.controller_name, parameters.node_options);
        node_->controller = this;
        rate_ = parameters.update_rate;
        for (const auto &own : parameters.node_options.parameter_overrides()) {
            if (own.get_name() == "update_rate") {
                rate_ = static_cast<unsigned int>(std::get<std::int64_t>(own.value()));
            }
        }
        return on_init() == CallbackReturn::SUCCESS ? return_type::OK : return_type::ERROR;
    }
    const rclcpp_lifecycle::State &configure() { return node_->configure(); }
    std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
    unsigned int get_update_rate() const { return rate_; }
    bool is_in_chained_mode() const { return is_chained_; }
    bool set_chained_mode(bool is_chained) {
        is_chained_ = is_chained;
        return true;
    }
    std::vector<hardware_interface::CommandInterface::SharedPtr> export_reference_interfaces() {
        std::vector<hardware_interface::CommandInterface::SharedPtr> made;
        for (auto &each : on_export_reference_interfaces()) {
            made.push_back(std::make_shared<hardware_interface::CommandInterface>(each));
        }
        return made;
    }
    void assign_interfaces(std::vector<hardware_interface::LoanedCommandInterface> &&commands,
                           std::vector<hardware_interface::LoanedStateInterface> &&states) {
        command_interfaces_ = std::move(commands);
        state_interfaces_ = std::move(states);
    }
    void release_interfaces() {
        command_interfaces_.clear();
        state_interfaces_.clear();
    }
    return_type update(const rclcpp::Time &time, const rclcpp::Duration &period) {
        if (!is_chained_ && update_reference_from_subscribers(time, period) != return_type::OK) {
            return return_type::ERROR;
        }
        return update_and_write_commands(time, period);
    }

protected:
    virtual std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() = 0;
    virtual return_type update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    virtual return_type update_and_write_commands(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    template <class Value> void auto_declare(const std::string &name, const Value &value) { node_->declare_parameter(name, value); }

    std::vector<double> reference_interfaces_;
    std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
    std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

private:
    std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_;
    unsigned int rate_ = 0;
    bool is_chained_ = false;
};

} // namespace controller_interface

#endif
