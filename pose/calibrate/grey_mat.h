#pragma once

#include <opencv2/core.hpp>

#include "pose/centres/image_view.h"

namespace tbm {

// The image as OpenCV sees it, in 8 bits. Where it has them already its pixels are not copied and
// must outlive the result, which nobody may write into.
cv::Mat GreyOf(const ImageView& image);

}  // namespace tbm
