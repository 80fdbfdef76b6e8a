/* Test double of cv::Mat: the members that tautscope.hpp uses. */

#ifndef OPENCV_MAT_DOUBLE_HPP
#define OPENCV_MAT_DOUBLE_HPP

#include <cstddef>

#define CV_8UC(channels) (((channels)-1) << 3)

namespace cv {
struct Mat {
    int rows = 0, cols = 0, dims = 2, channels = 3;
    unsigned char *data = nullptr;
    std::size_t step[2] = {0, 0};

    bool empty() const { return data == nullptr; }
    int type() const { return CV_8UC(channels); }
    std::size_t elemSize() const { return static_cast<std::size_t>(channels); }
};
} // namespace cv

#endif
