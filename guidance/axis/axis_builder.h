#pragma once

#include <optional>

#include "guidance/axis/design_axis.h"

namespace tbm {

// Makes a DesignAxis of a description; all that is odd goes to `remarks`, and every part is looked
// at, also when another one is refused.
struct AxisBuilder {
  static std::optional<DesignAxis> Build(const AxisDescription& description, AxisRemarks* remarks);
};

}  // namespace tbm
