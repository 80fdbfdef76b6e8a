/* Test double of realtime_tools, for one thread. */

namespace realtime_tools {
template <class Value> class RealtimeBuffer {
public:
    const Value *readFromRT() const { return &value_; }
    void writeFromNonRT(const Value &value) { value_ = value; }

private:
    Value value_{};
};
} // namespace realtime_tools
