/* Test double of pluginlib: the class that is linked. */

#ifndef DOUBLES_CLASS_LOADER_HPP
#define DOUBLES_CLASS_LOADER_HPP

#include <memory>
#include <string>

namespace pluginlib {

template <class Base> std::shared_ptr<Base> create_exported();

template <class Base> struct ClassLoader {
    ClassLoader(const std::string &, const std::string &) {}
    std::shared_ptr<Base> createSharedInstance(const std::string &) { return create_exported<Base>(); }
};

} // namespace pluginlib

#endif
