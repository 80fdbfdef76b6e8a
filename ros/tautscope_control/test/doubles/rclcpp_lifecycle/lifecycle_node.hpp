/* Test double of rclcpp_lifecycle: transitions call the node, without services. */

#ifndef DOUBLES_LIFECYCLE_NODE_HPP
#define DOUBLES_LIFECYCLE_NODE_HPP

#include <rclcpp/rclcpp.hpp>

namespace rclcpp_lifecycle {

class State {
public:
    explicit State(std::uint8_t id = lifecycle_msgs::msg::State::PRIMARY_STATE_UNCONFIGURED) : id_(id) {}
    std::uint8_t id() const { return id_; }

private:
    std::uint8_t id_;
};

namespace node_interfaces {
struct LifecycleNodeInterface {
    enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
    virtual ~LifecycleNodeInterface() = default;
    virtual CallbackReturn on_configure(const State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_activate(const State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_deactivate(const State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_cleanup(const State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_shutdown(const State &) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_error(const State &) { return CallbackReturn::SUCCESS; }
};
} // namespace node_interfaces

class LifecycleNode : public rclcpp::Node, public node_interfaces::LifecycleNodeInterface {
public:
    using Node::Node;
    using Primary = lifecycle_msgs::msg::State;

    const State &configure() { return go(target().on_configure(state_), Primary::PRIMARY_STATE_INACTIVE); }
    const State &activate() { return go(target().on_activate(state_), Primary::PRIMARY_STATE_ACTIVE); }
    const State &deactivate() { return go(target().on_deactivate(state_), Primary::PRIMARY_STATE_INACTIVE); }
    const State &shutdown() { return go(target().on_shutdown(state_), Primary::PRIMARY_STATE_FINALIZED); }
    const State &get_current_state() const { return state_; }

    /// The controller of this node has its callbacks.
    LifecycleNodeInterface *controller = nullptr;

private:
    LifecycleNodeInterface &target() { return controller ? *controller : *this; }
    const State &go(CallbackReturn result, std::uint8_t state) {
        if (result == CallbackReturn::SUCCESS) {
            state_ = State(state);
        }
        return state_;
    }
    State state_;
};

} // namespace rclcpp_lifecycle

#endif
