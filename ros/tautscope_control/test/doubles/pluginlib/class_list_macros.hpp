#include "class_loader.hpp"

#define PLUGINLIB_EXPORT_CLASS(Class, Base)                                                                            \
    template <> std::shared_ptr<Base> pluginlib::create_exported<Base>() { return std::make_shared<Class>(); }
