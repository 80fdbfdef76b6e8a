/* What differs between ros2_control of Humble and of Jazzy and later. */

#ifndef TAUTSCOPE_CONTROL__CHAINABLE_CONTROLLER_HPP_
#define TAUTSCOPE_CONTROL__CHAINABLE_CONTROLLER_HPP_

#include <optional>

#include <controller_interface/chainable_controller_interface.hpp>
#include <hardware_interface/version.h>

namespace tautscope_control {

/// Chainable controller with one interface for all distributions.
class ChainableController : public controller_interface::ChainableControllerInterface {
protected:
    /// Takes the references of the subscriptions, where no other controller gives them.
    virtual controller_interface::return_type read_references() = 0;

    /// Whether the controller is updated at `rate` [Hz], or as often as the controller manager at a rate that is not known.
    bool is_updated_at(double rate) const {
        const double given = get_update_rate();
        // Humble has 0 for the rate of the controller manager.
        return given == 0.0 || (given > 0.99 * rate && given < 1.01 * rate);
    }

#if HARDWARE_INTERFACE_VERSION_MAJOR < 3 // Humble
    controller_interface::return_type update_reference_from_subscribers() final { return read_references(); }
#else
    controller_interface::return_type update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) final {
        return read_references();
    }
#endif
};

/// The value of an interface; none while it is being written.
inline std::optional<double> read(const hardware_interface::LoanedStateInterface &interface) {
#if HARDWARE_INTERFACE_VERSION_MAJOR < 3
    return interface.get_value();
#else
    return interface.get_optional();
#endif
}

/// Sets the value of an interface; one that is being read at this moment keeps its value.
inline void write(hardware_interface::LoanedCommandInterface &interface, double value) {
    static_cast<void>(interface.set_value(value));
}

} // namespace tautscope_control

#endif
