/* Test double of hardware_interface. */

namespace hardware_interface {
constexpr char HW_IF_POSITION[] = "position";
}
