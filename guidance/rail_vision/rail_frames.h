#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "pose/base/time.h"
#include "pose/centres/image_view.h"

namespace tbm {

// A run's images, as somebody reads them.
struct RailFrames {
  std::vector<Timestamp> stamped_at;  // by the camera's clock, each later than the one before
  // The pixels of one of them, valid until the next call; without pixels where there are none.
  std::function<ImageView(std::size_t frame)> load;
};

}  // namespace tbm
