#include "pose/calibrate/grey_mat.h"

#include <cstddef>

namespace tbm {

cv::Mat GreyOf(const ImageView& image) {
  const int type = image.bytes_per_pixel == 1 ? CV_8UC1 : CV_16UC1;
  // OpenCV has no Mat of const pixels.
  const cv::Mat all(image.height_px,
                    image.width_px,
                    type,
                    const_cast<void*>(image.pixels),
                    static_cast<std::size_t>(image.stride_bytes));
  if (image.bytes_per_pixel == 1 && image.max_value == 255) return all;
  cv::Mat grey;
  all.convertTo(grey, CV_8U, 255.0 / static_cast<double>(image.max_value));
  return grey;
}

}  // namespace tbm
