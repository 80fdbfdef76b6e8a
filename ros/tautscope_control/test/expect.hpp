/* Conditions of a test; `failures` counts those that do not hold. */

#ifndef EXPECT_HPP
#define EXPECT_HPP

#include <cstdio>

inline int failures = 0;

#define EXPECT(condition)                                                                                              \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            std::printf("line %d: %s\n", __LINE__, #condition);                                                        \
            ++failures;                                                                                                \
        }                                                                                                              \
    } while (false)

#endif
