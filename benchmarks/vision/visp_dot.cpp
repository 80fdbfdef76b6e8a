// Tracks one blob with ViSP's vpDot2 and prints the median time of a track (us).
//
// Arguments: raw 8-bit grey image, width, height, u and v of a pixel of the blob, repeats.

#include <visp3/blob/vpDot2.h>
#include <visp3/core/vpImage.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <vector>

int main(int argc, char **argv) {
  if (argc != 7) {
    std::cerr << "usage: visp_dot IMAGE WIDTH HEIGHT U V REPEATS\n";
    return 2;
  }
  const unsigned width = std::atoi(argv[2]), height = std::atoi(argv[3]);
  const int repeats = std::atoi(argv[6]);
  vpImage<unsigned char> image(height, width);
  std::ifstream file(argv[1], std::ios::binary);
  file.read(reinterpret_cast<char *>(image.bitmap), std::streamsize(width) * height);
  if (!file) {
    std::cerr << "the image is too short\n";
    return 2;
  }
  vpDot2 dot;
  dot.setGraphics(false);
  dot.setComputeMoments(false);
  dot.setGrayLevelPrecision(0.5);
  dot.setEllipsoidShapePrecision(0);
  dot.initTracking(image, vpImagePoint(std::atof(argv[5]), std::atof(argv[4])));
  std::vector<double> times;
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    dot.track(image);
    const std::chrono::duration<double, std::micro> spent = std::chrono::steady_clock::now() - start;
    times.push_back(spent.count());
  }
  std::nth_element(times.begin(), times.begin() + repeats / 2, times.end());
  std::cout << times[repeats / 2] << ' ' << dot.getArea() << '\n';
}
